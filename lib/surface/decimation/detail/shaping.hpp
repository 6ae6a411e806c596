#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <span>

namespace tunica {

/// Where a surface leaves no choice but a small angle.
struct SharpCorner {
  Vec3 at;
  bool on_boundary;
  double angle;  ///< degrees, of its narrowest sector
  /// What a triangle there may have, so that two can share the sector; narrower ones are faults of a mesh.
  [[nodiscard]] double least_angle() const { return 0.5 * angle; }
};

/// The vertices of a surface with a sector between edges of its boundary or creases that is narrower than `limit`,
/// degrees. Cost: linear.
std::vector<SharpCorner> sharp_corners(const TriangleMesh& mesh, double limit);

struct ShapingOptions {
  double min_angle = 20;                       ///< degrees, at most 40
  std::size_t triangles = 0;                   ///< at most this many
  std::span<const SharpCorner> sharp_corners;  ///< of the target, for min_angle; they must live as long
  Progress progress;
};

/// Gives a coarse mesh good triangles and lets it stay as close to its target as they allow: edges flip, vertices move
/// (least squares onto the target, sideways towards good shape), triangles go from where they are not needed to where
/// the error is. Every change must lessen one sum, of fourth powers of the triangles' errors and of their lack of
/// shape.
/// @param mesh    an oriented manifold near the target with the same boundary loops
/// @param target  the surface meant; `tree` is over it
/// Keeps: topology, boundary (its vertices on the target's boundary curves), sharp corners that the mesh has as well (a
/// vertex goes there and stays), the side each triangle faces.
/// Deterministic, independent of the number of threads.
/// Source: Hoppe et al., Mesh optimization, SIGGRAPH 1993 (energy and moves); here with the largest error in mind.
/// Cost: about 10 ms per triangle of the result. Limits: errors are those of points; certify afterwards.
TriangleMesh shaped(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree,
                    const ShapingOptions& options);

/// The smallest angle of a mesh, degrees, but for those below `limit` at sharp corners of its target that are not
/// narrower than such a corner makes them (SharpCorner::least_angle).
/// @param sharp  sharp_corners() of the target for the same limit
double smallest_free_angle(const TriangleMesh& mesh, std::span<const SharpCorner> sharp, double limit);

}  // namespace tunica
