#include "volume/outward.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

Index root_of(std::vector<Index>& parent, Index vertex) {
  while (parent[vertex] != vertex) {
    parent[vertex] = parent[parent[vertex]];
    vertex = parent[vertex];
  }
  return vertex;
}

}  // namespace

bool faces_outward(const TriangleMesh& mesh, const Mask& mask) {
  const Mat3 to_index = mask.affine().leftCols<3>().inverse();
  const Vec3 origin = mask.affine().col(3);
  const double step = 0.5 * mask.affine().leftCols<3>().colwise().norm().minCoeff();
  const auto inside = [&](const Vec3& point) {
    const Vec3 index = (to_index * (point - origin)).array().round();
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      if (!(index[axis] >= 0) || index[axis] >= static_cast<double>(mask.dims()[static_cast<std::size_t>(axis)])) {
        return false;
      }
    }
    return mask(static_cast<std::size_t>(index.x()), static_cast<std::size_t>(index.y()),
                static_cast<std::size_t>(index.z()));
  };

  std::vector<Index> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), Index{0});
  for (const auto& [a, b, c] : mesh.triangles) {
    parent[root_of(parent, a)] = root_of(parent, b);
    parent[root_of(parent, b)] = root_of(parent, c);
  }
  std::vector<double> votes(mesh.vertices.size(), 0.0);
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 twice_area = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    const double size = twice_area.norm();
    const Index root = root_of(parent, a);
    used[root] = true;
    if (size > 0) {
      const Vec3 centre = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3;
      const Vec3 offset = step / size * twice_area;
      votes[root] += size * (static_cast<int>(inside(centre - offset)) - static_cast<int>(inside(centre + offset)));
    }
  }
  for (std::size_t vertex = 0; vertex < votes.size(); ++vertex) {
    if (used[vertex] && !(votes[vertex] > 0)) {
      return false;
    }
  }
  return true;
}

}  // namespace tunica
