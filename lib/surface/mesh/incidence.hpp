#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <span>

namespace tunica {

/// The triangles around each vertex, in two flat arrays.
struct Incidence {
  std::vector<std::size_t> offsets;  ///< #V + 1
  std::vector<Index> triangles;      ///< 3 #F: those of vertex v are [offsets[v], offsets[v + 1]), ascending

  [[nodiscard]] std::span<const Index> of(Index vertex) const {
    return {triangles.data() + offsets[vertex], triangles.data() + offsets[vertex + 1]};
  }
};

/// Errors: InputError where a corner does not exist; of neighbours() and boundary_loops(), too. Cost: linear.
Incidence incidence(std::size_t vertices, std::span<const std::array<Index, 3>> triangles);
inline Incidence incidence(const TriangleMesh& mesh) { return incidence(mesh.vertices.size(), mesh.triangles); }

/// For each triangle t and k = 0, 1, 2 the triangle across the edge from corner k to corner k + 1; `no_neighbour` at a
/// boundary and where the edge is not shared by exactly two triangles.
/// Parallel.
inline constexpr Index no_neighbour = 0xffffffff;
std::vector<std::array<Index, 3>> neighbours(std::span<const std::array<Index, 3>> triangles, const Incidence& around);
inline std::vector<std::array<Index, 3>> neighbours(const TriangleMesh& mesh, const Incidence& around) {
  return neighbours(mesh.triangles, around);
}

/// The boundary edges: triangle t, and k of the edge from its corner k to corner k + 1; in the order of (t, k).
/// @param across  neighbours()
std::vector<std::array<Index, 2>> boundary_edges(std::span<const std::array<Index, 3>> across);

/// The boundary of an oriented manifold as closed loops of vertices, each in the direction of its triangles' edges.
/// Limits: where the boundary touches itself at a vertex, the loops there are split in one of the possible ways.
/// @param across  neighbours(), where known
std::vector<std::vector<Index>> boundary_loops(std::span<const std::array<Index, 3>> triangles,
                                               std::span<const std::array<Index, 3>> across);
std::vector<std::vector<Index>> boundary_loops(const TriangleMesh& mesh);

}  // namespace tunica
