#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// How many triangles have an angle below the limit of the state.
std::size_t count_thin(const FitState& state);

/// Mends triangles with angles below the limit: edges flip, nodes slide where the angles around them are better and are
/// fitted there, as long as no error gets above `limit` (mm) and above what it was. @return how many are left
std::size_t mend_angles(FitState& state, double limit);

/// The same by means of further nodes: cuts thin triangles, and keeps that where fewer are left and no error is above
/// `limit` (mm). @param most  shells
void split_thin(FitState& state, double limit, std::size_t most);

}  // namespace tunica
