#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Takes a node out and covers what its triangles covered with the triangulation of the ring around it whose worst
/// patch is closest to the target: more ways than mergers have, for where these would fold, be too thin or change the
/// topology. No other node moves. Not for held nodes, nor for those on creases.
/// @return whether such a triangulation has sound facets, and patches within `limit` (mm)
/// Cost: a patch is measured for each three of the at most twelve nodes of the ring.
bool remove_node(FitState& state, Index node, double limit);

}  // namespace tunica
