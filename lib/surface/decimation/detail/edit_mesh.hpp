#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <algorithm>

namespace tunica {

/// A manifold under edit: triangles vanish and appear, vertices move. Triangles that are gone have no corners; their
/// places are used again.
struct EditMesh {
  static constexpr Index none = 0xffffffff;

  std::vector<Vec3> positions;                  ///< #V
  std::vector<std::array<Index, 3>> triangles;  ///< #T
  std::vector<std::vector<Index>> around;       ///< #V triangles around each vertex; empty: the vertex is gone
  std::vector<std::uint8_t> on_boundary;        ///< #V
  std::vector<Index> free_triangles;
  std::size_t alive = 0;  ///< triangles

  /// @param mesh  an oriented manifold
  explicit EditMesh(const TriangleMesh& mesh);

  [[nodiscard]] bool is_alive(Index t) const { return triangles[t][0] != none; }
  /// 0, 1 or 2: where in triangle t the vertex stands.
  [[nodiscard]] std::size_t corner_of(Index t, Index vertex) const {
    const auto& c = triangles[t];
    return c[0] == vertex ? 0 : c[1] == vertex ? 1 : 2;
  }
  [[nodiscard]] bool has(Index t, Index vertex) const {
    const auto& c = triangles[t];
    return c[0] == vertex || c[1] == vertex || c[2] == vertex;
  }

  /// The triangles that run from u to v (first) and from v to u (second); none where there is no such triangle.
  [[nodiscard]] std::array<Index, 2> on_edge(Index u, Index v) const;

  /// The third corner of a triangle with the edge u, v.
  [[nodiscard]] Index apex(Index t, Index u, Index v) const {
    const auto& c = triangles[t];
    return c[0] != u && c[0] != v ? c[0] : c[1] != u && c[1] != v ? c[1] : c[2];
  }

  /// Neighbours of a vertex, each once, ascending.
  void ring(Index vertex, std::vector<Index>& out) const;

  /// Whether merging the ends keeps the surface what it is: link condition, no boundaries brought together.
  [[nodiscard]] bool may_collapse(Index u, Index v) const;

  /// Whether the edge is an inner one and its other diagonal does not exist yet.
  [[nodiscard]] bool may_flip(Index u, Index v) const;

  Index add_triangle(const std::array<Index, 3>& corners);
  void remove_triangle(Index t);
  Index add_vertex(const Vec3& position, bool boundary);

  /// Edges (u < v) in a deterministic order.
  [[nodiscard]] std::vector<std::array<Index, 2>> edges() const;

  [[nodiscard]] TriangleMesh mesh() const;
};

}  // namespace tunica
