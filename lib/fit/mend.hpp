#pragma once

#include "shell/target.hpp"

namespace tunica {

struct Mending {
  std::size_t turned = 0;   ///< edges
  std::size_t merged = 0;   ///< pairs of nodes
  std::size_t shifted = 0;  ///< nodes
};

/// What is repaired.
struct MendLimits {
  double angle = 10;       ///< degrees: triangles with a smaller angle
  double agreement = 0.4;  ///< nodes without a normal that agrees with all of their facets by this
  double straying = 1.5;   ///< farther from the target than what they replace new facets are at most, by this factor
};

/// Repairs what no curved shell can stand on: thin triangles, and nodes whose facets fold. Around each the best of
/// these is done, as long as it lessens the sum of squared shortfalls of angles and agreements: turn an edge, merge two
/// nodes, shift a node towards the middle of its ring on the target. Topology and boundary nodes stay. No new facet
/// strays (at its centroid and edge middles) farther from the target than `off_target` (mm) and than `straying` times
/// those that it replaces. Nodes may vanish: the mesh is renumbered in the order of its nodes. Deterministic. Cost:
/// linear for a good mesh; about 10 ms per bad place.
Mending mend(const Target& target, TriangleMesh& mesh, double off_target, const MendLimits& limits = {});

}  // namespace tunica
