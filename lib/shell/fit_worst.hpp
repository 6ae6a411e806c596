#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Cuts the longest edge (by a node of its own) of the patches whose error is above `limit` (mm), worst first, at most
/// `most` edges. @return how many
std::size_t split_worst(FitState& state, double limit, std::size_t most);

/// Places the nodes around patches with an error above `limit` anew, one by one. @return how many got better
std::size_t place_worst(FitState& state, double limit);

/// Whether a few patches are much farther off than the others: shells of the others would serve better there.
bool is_uneven(const FitState& state);

}  // namespace tunica
