#pragma once

#include "tunica/surface/mesh/tet_checks.hpp"

/// Meshes of tetrahedra with known answers.
namespace tunica::shapes {

/// The unit cube as n^3 cubes of six tetrahedra around their diagonals.
inline TetMesh tet_cube(Index n) {
  TetMesh mesh;
  const auto at = [&](Index i, Index j, Index k) { return (k * (n + 1) + j) * (n + 1) + i; };
  for (Index k = 0; k <= n; ++k) {
    for (Index j = 0; j <= n; ++j) {
      for (Index i = 0; i <= n; ++i) {
        mesh.vertices.push_back(Vec3(i, j, k) / n);
      }
    }
  }
  for (Index k = 0; k < n; ++k) {
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        const Index low = at(i, j, k);
        const Index high = at(i + 1, j + 1, k + 1);
        const Index ring[] = {at(i + 1, j, k),     at(i + 1, j + 1, k), at(i, j + 1, k),
                              at(i, j + 1, k + 1), at(i, j, k + 1),     at(i + 1, j, k + 1)};
        for (std::size_t r = 0; r < 6; ++r) {
          mesh.tetrahedra.push_back({low, ring[r], ring[(r + 1) % 6], high});
        }
      }
    }
  }
  return mesh;
}

/// Sum of the tetrahedra's volumes.
inline double volume(const TetMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c, d] : mesh.tetrahedra) {
    sum += tet_volume(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c], mesh.vertices[d]);
  }
  return sum;
}

}  // namespace tunica::shapes
