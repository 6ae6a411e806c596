#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// From slivers to triangles that carry patches.
/// @param limit  mm; @param creased  mm: patches farther off may get normals of their own
void smooth(FitState& state, double limit, double creased);

/// Steps of all nodes, edges turned, and single nodes and patches mended that are above `limit` (mm). The state must
/// have been attached and measured, and is so in the end. Cost: linear in the shells and the samples, per step.
void polish(FitState& state, double limit, int steps);

/// Polishes until that brings little, at most so many times.
void settle(FitState& state, int most);

/// Splits where the error is above `limit` (mm) and polishes, until it is not, that brings nothing, or there are `most`
/// shells.
void repair(FitState& state, double limit, std::size_t most);

}  // namespace tunica
