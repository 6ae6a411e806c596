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
  };
  [[nodiscard]] Hit at(const Vec3& p) const;

  [[nodiscard]] const std::vector<Vec3>& vertices() const { return surface_.vertices(); }

private:
  ClosestPoint surface_;
  std::vector<std::array<Vec3, 7>> pseudo_normals_;  ///< per triangle: face, edges, corners
};

}  // namespace tunica
