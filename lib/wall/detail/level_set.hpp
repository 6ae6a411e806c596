#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/wall/detail/continued_face.hpp"

#include <cstddef>

namespace tunica {

/// A distance from a face of a wall to one of its sides.
struct HalfWayLevel {
  const ContinuedFace& face;
  double half;  ///< mm, greater than zero
  int side;     ///< 1: outside, -1: inside

  /// How far a point is outside of the level, mm; the sign of what is beyond the end of a strip means nothing.
  [[nodiscard]] double value(const ContinuedFace::Hit& hit) const { return hit.distance - side * half; }
  /// The place on the level that a point's nearest point of the face has there.
  [[nodiscard]] Vec3 foot_on(const Vec3& p, const ContinuedFace::Hit& hit) const;
  /// The point moved onto the level, as nearly as a few steps lead.
  [[nodiscard]] Vec3 moved_onto(Vec3 p) const;
};

/// How many points a grid with cells so large needs.
double grid_points(const HalfWayLevel& level, double cell);

/// The level as marching cubes find it, normals outward, vertices within a cell of it. At a face with rims there is
/// more: what bounds the continued face's inside beyond the strips' ends.
TriangleMesh marched_level(const HalfWayLevel& level, double cell, const Progress& progress);

}  // namespace tunica
