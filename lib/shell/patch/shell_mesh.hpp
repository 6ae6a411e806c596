#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <optional>

namespace tunica {

/// Which patch the positions and normals of a shell mesh stand for (`surface=` in the file).
enum class Patch {
  comas,       ///< the paper's 9-term cubic over each facet, averaged over the three choices of the first vertex
  watertight,  ///< a cubic Bezier triangle whose edge curves neighbours share
};

/// A triangle mesh with a unit normal per vertex. The normals fix the slopes at the nodes, so positions and normals
/// together ARE the curved surface. At a crease the normals of a triangle's corners replace the vertex normals.
struct ShellMesh {
  std::vector<Vec3> vertices;                       ///< #V positions, mm
  std::vector<std::array<Index, 3>> triangles;      ///< #F vertex indices
  std::vector<Vec3> normals;                        ///< #V unit vectors, outward
  std::vector<std::array<Vec3, 3>> corner_normals;  ///< empty, or #F: unit normals at each triangle's corners
  Patch patch = Patch::comas;

  [[nodiscard]] const Vec3& normal(std::size_t triangle, std::size_t corner) const {
    return corner_normals.empty() ? normals[triangles[triangle][corner]] : corner_normals[triangle][corner];
  }
};

/// The flat facets of a shell mesh.
inline TriangleMesh flat_facets(const ShellMesh& shell) { return {shell.vertices, shell.triangles}; }

}  // namespace tunica
