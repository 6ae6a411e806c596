#pragma once

#include "shell/fit_state.hpp"

namespace tunica {

/// Gauss-Newton steps of a node that is placed.
inline constexpr int placing_steps = 3;

/// What becomes of the patches around a node.
struct Trial {
  PlacedNode node;
  std::vector<PlacedPatch> patches;
  std::vector<Index> triangles;  ///< of the mesh, for each of the patches
  std::vector<Index> points;
  FitLimits limits;
};

/// Degrees, of a triangle's flat facet.
double smallest_angle(const FitState& state, Index t);

/// The points attached to a triangle become the trial's.
void gather(const FitState& state, Index t, Trial& trial);

/// What was worse before may stay so.
void ease_limits(const FitState& state, Index t, FitLimits& limits);

/// A triangle's patch as one of a trial's, with the places of the target that it was last close to.
PlacedPatch placed(const FitState& state, Index t);

/// Fills in what lies across the edges of the trial's patches, and the creases of watertight ones.
/// @param nodes  of each patch's corners, as they will be; replaced  triangles of the mesh that the patches stand for
void link(const FitState& state, const std::vector<std::array<Index, 3>>& nodes, const std::vector<Index>& replaced,
          Trial& trial);

/// A start where the facets do not suit the normal gets one that does.
void make_compatible(Trial& trial);

}  // namespace tunica
