#pragma once

#include <cstddef>

namespace tunica {

/// Things of one kind (elements, points) that a run computes at once (lanes.hpp).
inline constexpr std::size_t lane_count = 4;

}  // namespace tunica
