#pragma once

#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/measure.hpp"

namespace tunica {

/// The two-sided distance, certainly not less, to 1e-5 of the diagonal of b.
inline double distance(const TriangleMesh& a, const TriangleMesh& b) {
  HausdorffOptions options;
  options.width = 1e-5 * diagonal(b);
  options.samples = 0;
  return hausdorff(a, b, options).both.upper;
}

/// Decimated to a count, with or without a smallest angle in degrees.
inline DecimateResult decimated_to(const TriangleMesh& mesh, std::size_t triangles,
                                   const std::optional<double>& angle = {}) {
  DecimateOptions options;
  options.triangles = triangles;
  options.min_angle = angle;
  return decimate(mesh, options);
}

}  // namespace tunica
