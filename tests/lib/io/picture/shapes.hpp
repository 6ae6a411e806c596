#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <map>

namespace tunica {

/// A sphere about the origin: an octahedron whose triangles are split `levels` times. 8 * 4^levels triangles.
inline TriangleMesh make_sphere(double radius, int levels) {
  TriangleMesh mesh;
  mesh.vertices = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<Index, Index>, Index> middles;
    const auto middle = [&](Index a, Index b) {
      const auto [entry, added] = middles.try_emplace(std::minmax(a, b), static_cast<Index>(mesh.vertices.size()));
      if (added) {
        mesh.vertices.push_back((mesh.vertices[a] + mesh.vertices[b]).normalized());
      }
      return entry->second;
    };
    std::vector<std::array<Index, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangles) {
      const Index ab = middle(a, b);
      const Index bc = middle(b, c);
      const Index ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.triangles = finer;
  }
  for (Vec3& vertex : mesh.vertices) {
    vertex *= radius;
  }
  return mesh;
}

/// A cube of side 2 about the origin, faces outward.
inline TriangleMesh make_box() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(i % 2 == 0 ? -1 : 1, i / 2 % 2 == 0 ? -1 : 1, i / 4 == 0 ? -1 : 1);
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

/// Appends a square across the xz plane at the given y, half as wide as `half`, facing -y.
inline void append_square(TriangleMesh& mesh, double half, double y) {
  const auto first = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {{-half, y, -half}, {half, y, -half}, {half, y, half}, {-half, y, half}});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

}  // namespace tunica
