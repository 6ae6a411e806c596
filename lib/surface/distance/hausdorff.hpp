#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <optional>

namespace tunica {

struct HausdorffOptions {
  /// mm: how wide the interval of each direction may be (upper - lower).
  double width = 0;
  /// mm: how far each true surface may lie from the given triangles, both ways; the intervals are widened by it.
  double deviation_a = 0;
  double deviation_b = 0;
  /// mm: only whether the distance is at most this matters. The work stops as soon as that is decided, so the interval
  /// is then as wide as it happens to be, but it lies on one side of the limit unless its width is below `width`.
  std::optional<double> limit;
  /// How many points the mean and the root mean square are taken from; 0: they are not computed (NaN).
  std::size_t samples = 100'000;
  /// Where the work ends even if the interval is still too wide. A split costs about a microsecond.
  std::size_t max_splits = 20'000'000;
  Progress progress;
};

struct HausdorffResult {
  Interval both;    ///< mm, two-sided
  Interval a_to_b;  ///< mm, the largest distance of a point of A to B
  Interval b_to_a;
  double mean = 0;  ///< mm, of the distance from A to B over A's area; true to about 1 %
  double rms = 0;
  Vec3 worst_a = Vec3::Zero();  ///< where both.lower is attained: a point of A
  Vec3 worst_b = Vec3::Zero();  ///< and of B
};

/// Two-sided Hausdorff distance of two surfaces as a certified interval, rounded outward: the true value is inside.
/// Branch and bound over pieces of triangles. From below: distances of points of the piece. From above: the distance
/// to one triangle of the other surface is convex, so its largest value over a piece is at a corner; the least of that
/// over a few triangles bounds the piece. Pieces are cut where two triangles of the other surface tie, or in half.
/// The result does not depend on the number of threads.
/// @return intervals of at most `width` plus 2 (deviation_a + deviation_b) plus rounding, unless max_splits was
/// reached. Errors: InputError: a surface as for ClosestPoint, a width, deviation or limit that is negative or not
/// finite; Interrupted. Source: bounds as in Tang, Lee, Kim, Interactive Hausdorff distance computation for
/// general polygonal models (2009). Cost: the distance query of each vertex that is not near enough by its neighbour's
/// answer, then a few thousand splits on smooth surfaces. Limits: mean and rms come from samples (systematic over the
/// area).
HausdorffResult hausdorff(const TriangleMesh& a, const TriangleMesh& b, const HausdorffOptions& options);

/// The same for surfaces whose trees exist already.
HausdorffResult hausdorff(const ClosestPoint& a, const ClosestPoint& b, const HausdorffOptions& options);

/// Distance from each vertex of `mesh` to `surface`, mm. Parallel.
std::vector<double> vertex_distances(const TriangleMesh& mesh, const ClosestPoint& surface);

}  // namespace tunica
