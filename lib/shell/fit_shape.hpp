#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// How many triangles have an angle below the limit of the state.
std::size_t count_thin(const FitState& state);

/// Mends triangles with angles below the limit: edges flip, nodes slide where the angles around them are better and are
/// fitted there, as long as no error gets above `limit` (mm) and above what it was. @return how many are left
std::size_t mend_angles(FitState& state, double limit);

/// The same by merging the nodes of a thin triangle's shortest edge, or by a further node on its longest: kept where
/// fewer thin ones are left and no error is above `limit` (mm). @param most  shells
/// @param patience  tries that fail before it gives up; it tries none where more than three times as many are left
void rid_of_thin(FitState& state, double limit, std::size_t most, std::size_t patience = 16);

}  // namespace tunica
