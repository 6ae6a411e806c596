#pragma once

#include "core/progress.hpp"
#include "surface/closest_point.hpp"

namespace tunica {

struct ShapingOptions {
  double min_angle = 20;      ///< degrees, at most 40
  std::size_t triangles = 0;  ///< at most this many
  Progress progress;
};

/// Gives a coarse mesh good triangles and lets it stay as close to its target as they allow: edges flip, vertices move
/// (least squares onto the target, sideways towards good shape), triangles go from where they are not needed to where
/// the error is. Every change must lessen one sum, of fourth powers of the triangles' errors and of their lack of
/// shape.
/// @param mesh    an oriented manifold near the target with the same boundary loops
/// @param target  the surface meant; `tree` is over it
/// Keeps: topology, boundary (its vertices on the target's boundary curves), the side each triangle faces.
/// Deterministic, independent of the number of threads.
/// Source: Hoppe et al., Mesh optimization, SIGGRAPH 1993 (energy and moves); here with the largest error in mind.
/// Cost: about 10 ms per triangle of the result. Limits: errors are those of points; certify afterwards.
TriangleMesh shaped(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree,
                    const ShapingOptions& options);

/// The smallest angle of a mesh, degrees, but for those where its target leaves no choice: at corners of the target's
/// boundary and creases that are themselves sharper than `limit`.
double smallest_free_angle(const TriangleMesh& mesh, const TriangleMesh& target, double limit);

}  // namespace tunica
