// fit: a coarse mesh and a target in, shells out: the fit, and the paper's barycentre rule.
#pragma once

#include "tunica/shell/distance/target.hpp"

namespace tunica {

/// What became of the nodes in one application of the rule.
struct NodeMoves {
  std::size_t by_rule = 0;           ///< to the barycentre of three centroids
  std::size_t to_closest_point = 0;  ///< where the barycentre would have been worse
  std::size_t on_boundary = 0;       ///< along the target's boundary curve
  std::size_t shortened = 0;  ///< stopped on the way, or held, for a triangle that would have flipped or collapsed
  double largest = 0;         ///< mm, the longest way a node went
};

/// Which boundary loop of the target each boundary loop of the mesh belongs to: pairs that run the same way by
/// ascending mean distance, each target loop once while there are free ones. @return indices into target.boundary();
/// nothing for an open mesh on a closed target.
std::vector<std::optional<std::size_t>> match_boundaries(const Target& target, const TriangleMesh& mesh,
                                                         const std::vector<std::vector<Index>>& loops);

/// Moves every node once by the paper's rule: to the barycentre of the centroids of the three closest target triangles,
/// closest by their centroids. With what the rule lacks:
/// * only triangles on the side that the facets around the node face count, so that no node of a thin organ jumps to
///   the opposite wall;
/// * a barycentre farther from the target than `off_target` (mm) and than the node itself, or beside the closest point
/// by
///   more than half the shortest edge at the node (target triangles larger than the shells), is replaced by the closest
///   point;
/// * boundary nodes go to the closest point of the target's boundary curve that belongs to their loop, in their order
///   along it, so that a loop neither shrinks nor folds;
/// * moves that would flip or collapse a triangle are halved, at last held.
/// Source: Comas, Duriez, Cotin 2010, section 3. Cost: a few microseconds per node.
/// Limits: the rule places nodes off the target by the size of the target's triangles squared times its curvature; it
/// settles there, within one or two moves.
NodeMoves move_by_barycentre(const Target& target, TriangleMesh& mesh, double off_target);

}  // namespace tunica
