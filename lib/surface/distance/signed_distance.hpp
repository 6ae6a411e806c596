#pragma once

#include "tunica/surface/distance/closest_point.hpp"

namespace tunica {

/// Distance from a closed surface, negative inside: the nearest point, and by the angle-weighted normal there the side.
/// Source: Baerentzen, Aanaes 2005, "Signed distance computation using the angle weighted pseudonormal".
/// Cost: as ClosestPoint. Limits: a surface that is open or crosses itself has no inside.
class SignedDistance {
public:
  explicit SignedDistance(const TriangleMesh& closed);

  struct Hit {
    double distance = 0;                ///< mm
    Vec3 point = Vec3::Zero();          ///< the nearest of the surface
    Vec3 pseudo_normal = Vec3::Zero();  ///< there, outward, of any length
    Index triangle = 0;                 ///< that it lies on
    std::size_t part = 0;  ///< of this: 0 within, 1 + k on the edge from corner k to k + 1, 4 + k on corner k
  };
  [[nodiscard]] Hit at(const Vec3& p) const { return with_sign(p, surface_.closest(p)); }
  /// The same, faster, when a triangle that is probably close is known.
  [[nodiscard]] Hit at(const Vec3& p, Index guess) const { return with_sign(p, surface_.closest(p, guess)); }

  [[nodiscard]] const std::vector<Vec3>& vertices() const { return surface_.vertices(); }

private:
  [[nodiscard]] Hit with_sign(const Vec3& p, const ClosestPoint::Hit& hit) const;

  ClosestPoint surface_;
  std::vector<std::array<Vec3, 7>> pseudo_normals_;  ///< per triangle: face, edges, corners
};

}  // namespace tunica
