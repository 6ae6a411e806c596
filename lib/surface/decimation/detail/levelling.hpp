#pragma once

#include "tunica/surface/decimation/detail/shape_patch.hpp"

namespace tunica {

/// An edge of a coarse mesh that may be collapsed, and where to.
struct CheapCollapse {
  Index kept, removed;
  Vec3 position;
};

/// Where the parts of a decimated mesh came from.
struct DecimationOrigins {
  std::vector<Index> stands_for;  ///< #V of the target: the vertex of the mesh that each was merged into
  std::vector<Index> triangles;   ///< #F of the mesh: the target's triangle that each was
};

struct LevellingOptions {
  std::size_t triangles = 0;             ///< at most this many; those that are missing are made use of
  bool closed = false;                   ///< whether it is known that there is no boundary
  bool thorough = false;                 ///< works as much where many triangles are left as where few are
  std::vector<CheapCollapse> collapses;  ///< cheapest first
  DecimationOrigins origins;
};

/// Lessens the largest error of a decimated mesh at its count. Over and over the place that is farthest off is mended:
/// an edge flips, a vertex moves, an edge is split or collapses; triangles that a split needs are taken by collapses
/// that leave less error than the largest. A change is made only if it lessens the largest error around it. Ends when
/// the worst place cannot be mended or after work in proportion to the triangles collapsed and, less, to all of the
/// target's.
/// @param mesh    an oriented manifold decimated from `target`
/// Keeps: topology, boundary (its vertices on the target's boundary curves), the side each triangle faces.
/// Deterministic. Source: moves as in Hoppe et al., Mesh optimization, SIGGRAPH 1993; here only the largest error
/// counts. Cost: about half a microsecond per triangle of the target. Limits: errors are those of points, found near
/// by; certify afterwards.
TriangleMesh levelled(const TriangleMesh& mesh, const TriangleMesh& target, const LevellingOptions& options);

struct WellShapedOptions {
  double angle = 20;          ///< degrees: no change may leave a smaller angle
  std::size_t triangles = 0;  ///< at most this many
  NearestPoint nearest;       ///< on the target
};

/// The same for a mesh under edit whose triangles are well shaped and stay so. Its errors must have been measured.
/// Cost: at most about 0.2 ms per triangle of the mesh.
void level_well_shaped(ShapedMesh& state, const TriangleMesh& target, const WellShapedOptions& options);

}  // namespace tunica
