#include "tunica/surface/distance/signed_distance.hpp"

#include "tunica/surface/mesh/incidence.hpp"

#include <cmath>

namespace tunica {

SignedDistance::SignedDistance(const TriangleMesh& closed)
    : surface_(closed), pseudo_normals_(closed.triangles.size()) {
  std::vector<Vec3> at_vertex(closed.vertices.size(), Vec3::Zero());
  const auto normal_of = [&](std::size_t t) {
    const auto& v = closed.triangles[t];
    const auto& x = closed.vertices;
    return Vec3((x[v[1]] - x[v[0]]).cross(x[v[2]] - x[v[0]]).normalized());
  };
  for (std::size_t t = 0; t < closed.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto corner = [&](std::size_t l) { return closed.vertices[closed.triangles[t][l % 3]]; };
      const Vec3 a = corner(k + 1) - corner(k), b = corner(k + 2) - corner(k);
      at_vertex[closed.triangles[t][k]] += std::atan2(a.cross(b).norm(), a.dot(b)) * normal_of(t);
    }
  }
  const auto beside = neighbours(closed, incidence(closed));
  for (std::size_t t = 0; t < closed.triangles.size(); ++t) {
    auto& normals = pseudo_normals_[t];
    normals[0] = normal_of(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = beside[t][k];
      normals[1 + k] = normals[0] + (other == no_neighbour ? Vec3(Vec3::Zero()) : normal_of(other));
      normals[4 + k] = at_vertex[closed.triangles[t][k]];
    }
  }
}

SignedDistance::Hit SignedDistance::with_sign(const Vec3& p, const ClosestPoint::Hit& hit) const {
  const auto corners = surface_.corners(hit.triangle);
  // Which part of the triangle the nearest point lies on says which normal has the right sign.
  const Vec3 b = barycentric(hit.point, corners[0], corners[1], corners[2]);
  constexpr double on_side = 1e-9;
  std::size_t part = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    if (b[(k + 2) % 3] < on_side) {
      part = 1 + k;  // edge k to k + 1
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    if (b[k] > 1 - on_side) {
      part = 4 + k;
    }
  }
  const Vec3& pseudo = pseudo_normals_[hit.triangle][part];
  const double sign = (p - hit.point).dot(pseudo) >= 0 ? 1 : -1;
  return {sign * (p - hit.point).norm(), hit.point, pseudo, hit.triangle, part};
}

}  // namespace tunica
