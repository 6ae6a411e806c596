#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Points of the target farther from the curved surface than `limit` (mm) join the samples; the state has to be
/// attached and measured anew to heed them. @return how many
/// @param errors  what is found of each patch's distance, both ways, raises its error
/// Cost: linear in the target's vertices, of which at most 200,000 are looked at: some 0.3 microseconds each.
std::size_t add_missed(FitSamples& samples, FitState& state, double limit, bool errors = false);

}  // namespace tunica
