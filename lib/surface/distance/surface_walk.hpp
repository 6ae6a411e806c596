#pragma once

#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"

namespace tunica {

/// A triangle made ready for many distances. Rounding as usual, no bound: thin triangles may be off by a little.
struct FlatTriangle {
  Vec3 a, ab, ac;
  double ab_ab, ab_ac, ac_ac;

  FlatTriangle(const Vec3& p, const Vec3& q, const Vec3& r)
      : a(p), ab(q - p), ac(r - p), ab_ab(ab.squaredNorm()), ab_ac(ab.dot(ac)), ac_ac(ac.squaredNorm()) {}

  /// The closest point is a + x ab + y ac.
  /// Source: Ericson, Real-time collision detection (2005), 5.1.5, with all products taken from five.
  [[nodiscard]] std::array<double, 2> closest(const Vec3& p) const;
  [[nodiscard]] double squared_distance(const Vec3& p) const {
    const auto [x, y] = closest(p);
    return (p - a - x * ab - y * ac).squaredNorm();
  }
};

/// Finds the point of a surface closest to p: by a grid the closest of many points of it, from there on from triangle
/// to triangle. Made in a fraction of the time of a ClosestPoint, but no bound: now and then it misses the closest one.
class SurfaceWalk {
public:
  /// Keeps a reference to `mesh`. Cost: linear, about 20 ns per triangle.
  explicit SurfaceWalk(const TriangleMesh& mesh);

  /// Cost: some 0.3 microseconds, and more the farther away `start` is.
  /// @param enough  squared distance: any point of the surface so near will do
  [[nodiscard]] ClosestPoint::Hit closest(const Vec3& p, Index start, double enough = -1) const;

  /// A point that is probably the closest, near `start` in any case. Cost: half of the above.
  [[nodiscard]] ClosestPoint::Hit near_by(const Vec3& p, Index start, double enough = -1) const;

private:
  [[nodiscard]] Index downhill(const Vec3& p, Index start) const;
  void try_triangle(Index t, const Vec3& p, ClosestPoint::Hit& hit, std::array<double, 2>& place) const;
  void search_around(Index vertex, const Vec3& p, ClosestPoint::Hit& hit, std::array<double, 2>& place) const;
  Index search_near(Index start, const Vec3& p, double enough, ClosestPoint::Hit& hit,
                    std::array<double, 2>& place) const;
  void place_points();
  [[nodiscard]] Index cube_of(const Vec3& p) const;
  [[nodiscard]] std::size_t cell(double x, int axis) const;

  const TriangleMesh& mesh_;
  Incidence around_;
  std::vector<std::uint8_t> at_boundary_;  // #V: some neighbour does not follow it in any triangle
  // Points of the surface sorted into cubes: the vertices, and points within triangles that are larger than a cube.
  struct Placed {
    Vec3 at;
    Index triangle;
  };
  Vec3 origin_;
  double cells_per_mm_ = 0;
  std::array<std::size_t, 3> cells_{};
  std::vector<Index> offsets_;  // of each cube in `placed_`
  std::vector<Placed> placed_;
};

}  // namespace tunica
