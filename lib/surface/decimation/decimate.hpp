// surface/decimation: edge collapse by quadrics, to a count, an error or a shape.
#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <optional>

namespace tunica {

struct DecimateOptions {
  std::optional<std::size_t> triangles;  ///< at most this many
  std::optional<double> max_error;       ///< mm: two-sided Hausdorff distance to the input, certainly at most this
  std::optional<double> min_angle;       ///< degrees, at most 40: no angle smaller, at the price of a larger error
  bool levelled = true;                  ///< without `min_angle`: the largest error is lessened, see below
  Progress progress;
};

struct DecimateResult {
  TriangleMesh mesh;
  bool count_reached = true;      ///< at most `triangles` are left
  bool error_kept = true;         ///< the distance is certainly at most `max_error`
  bool angle_held = true;         ///< no angle is below `min_angle`, but where the input itself is sharper
  double smallest_angle = 60;     ///< degrees, of those meant by `angle_held`, when `min_angle` was asked for
  std::optional<Interval> error;  ///< mm: what was certified, when `max_error` was asked for
  std::size_t closed_loops = 0;   ///< boundary loops of the input that were a point, see without_degenerate_triangles()
  double longest_spike = 0;       ///< mm, of the spikes without area that were taken away
  std::size_t long_spikes =
      0;  ///< spikes that stayed because `max_error` allows none so long; with `min_angle` none do
};

/// Fewer triangles for the same surface, by quadric edge collapse with optimal placement (see EdgeCollapse).
/// With `triangles` only: stops at that count, then lessens the largest error there (see levelled()); where more than a
/// fifth of the triangles stays, all planes count alike and that is all. With `max_error`
/// only: the fewest triangles found whose certified distance holds, levelled where that allows fewer. With both: as
/// with `triangles`; when the error does not allow that count, the fewest that it allows. With `min_angle` triangles
/// are well shaped (mean radius ratio about 0.87), see shaped(); the count stays. The mesh comes back also when a
/// requirement failed: the best that could be done.
/// @param mesh  an oriented manifold, closed or with boundary; unused vertices are dropped
/// Keeps: Euler number, pieces, boundary loops (their vertices stay on the given boundary curve), the side each
/// triangle faces; but boundary loops that are a point are closed. Degenerate triangles go, see
/// without_degenerate_triangles(), also spikes, up to nine tenths of `max_error`: `error` counts them. Deterministic,
/// independent of the number of threads, of the unit and of the place of the mesh. Errors: InputError when the mesh is
/// not fit (says where), the error negative or not finite, or the angle out of its range; Interrupted. Source: Garland,
/// Heckbert, Surface simplification using quadric error metrics, SIGGRAPH 1997. Cost: n log n; with `max_error` some
/// twenty distance measurements more. With `min_angle` about 5 ms per triangle of the result more, and some eight times
/// that with `max_error`. Limits: greedy; `max_error` looks among the meshes that the greedy order passes through, and
/// some of them levelled.
DecimateResult decimate(const TriangleMesh& mesh, const DecimateOptions& options);

}  // namespace tunica
