#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <meshoptimizer.h>

#include <limits>

namespace tunica {

/// A mesh as meshoptimizer takes it: single precision, about its first vertex.
struct MeshoptimizerMesh {
  Vec3 origin;
  std::vector<float> positions;
  std::vector<unsigned int> indices;

  explicit MeshoptimizerMesh(const TriangleMesh& mesh) : origin(mesh.vertices.front()) {
    for (const Vec3& p : mesh.vertices) {
      for (int axis = 0; axis < 3; ++axis) {
        positions.push_back(static_cast<float>(p[axis] - origin[axis]));
      }
    }
    for (const auto& triangle : mesh.triangles) {
      indices.insert(indices.end(), triangle.begin(), triangle.end());
    }
  }
};

/// meshoptimizer's quadric collapse to a count. Its vertices are some of the given ones.
inline std::vector<unsigned int> meshoptimizer_simplified(const MeshoptimizerMesh& mesh, std::size_t triangles) {
  std::vector<unsigned int> left(mesh.indices.size());
  left.resize(meshopt_simplify(left.data(), mesh.indices.data(), mesh.indices.size(), mesh.positions.data(),
                               mesh.positions.size() / 3, 3 * sizeof(float), 3 * triangles,
                               std::numeric_limits<float>::max(), 0));
  return left;
}

inline TriangleMesh from_meshoptimizer(const MeshoptimizerMesh& mesh, const std::vector<unsigned int>& indices) {
  TriangleMesh result;
  std::vector<Index> number(mesh.positions.size() / 3, 0xffffffff);
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    std::array<Index, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t v = indices[i + k];
      if (number[v] == 0xffffffff) {
        number[v] = static_cast<Index>(result.vertices.size());
        const float* p = &mesh.positions[3 * v];
        result.vertices.emplace_back(mesh.origin + Vec3(p[0], p[1], p[2]));
      }
      corners[k] = number[v];
    }
    result.triangles.push_back(corners);
  }
  return result;
}

}  // namespace tunica
