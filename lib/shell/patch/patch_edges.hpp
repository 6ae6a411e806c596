#pragma once

#include "tunica/shell/patch/curved_surface.hpp"

namespace tunica {

/// The edges of the fine triangles that lie on edges of their patches: vertices of the tessellation, in the order of
/// its triangles.
inline std::vector<std::array<Index, 2>> patch_edges(const Tessellation& surface) {
  const auto on_edge = [&](Index i, Index j) {
    const Vec2& p = surface.barycentric[i];
    const Vec2& q = surface.barycentric[j];
    return (p[0] == 0 && q[0] == 0) || (p[1] == 0 && q[1] == 0) || (p.sum() > 1 - 1e-9 && q.sum() > 1 - 1e-9);
  };
  std::vector<std::array<Index, 2>> edges;
  for (const auto& triangle : surface.mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::array<Index, 2> edge{triangle[k], triangle[(k + 1) % 3]};
      if (on_edge(edge[0], edge[1])) {
        edges.push_back(edge);
      }
    }
  }
  return edges;
}

}  // namespace tunica
