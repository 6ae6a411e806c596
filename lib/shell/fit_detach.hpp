#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Gives patches with an error above `limit` normals of their own at their corners where these, from flat, bring the
/// patch much closer: what no common normal can serve, a crease or a rim. The
/// neighbours of a watertight patch, which share its edges, must bear that. @return how many
std::size_t detach_worst(FitState& state, double limit);

/// Gives every corner a normal of its own. They start alike, and part by at most FitLimits::kink.
void part_normals(FitState& state);

/// Of the nodes, how many have normals of one sector that part by more than so many degrees.
double share_parted_by(const FitMesh& mesh, double degrees);

}  // namespace tunica
