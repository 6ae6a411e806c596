#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// A piece of a mesh under edit, cut out to be changed by itself: its nodes are numbered anew, and those at its rim
/// are held.
struct FitRegion {
  FitState state;
  std::vector<Index> triangles;  ///< of the whole, ascending
  std::vector<Index> nodes;      ///< of the whole, for each node there was when it was cut out
  std::vector<Index> slots;      ///< the same for the normals
};

/// The triangles around the nodes that are at most `rings` edges away from `nodes`. Cost: linear in the piece and in
/// the number of nodes and slots of the whole.
/// @param heed_rim  whether patches at the rim are measured by what they gape at beyond it: else only put_back() does
FitRegion cut_out(const FitState& whole, const std::vector<Index>& nodes, int rings, bool heed_rim = false);

/// Puts a changed piece back and measures it there, where it also meets its neighbours.
/// @param whole  as it was when the piece was cut out
/// @return the largest error of its patches and of those that it meets, mm
double put_back(const FitRegion& region, FitState& whole);

}  // namespace tunica
