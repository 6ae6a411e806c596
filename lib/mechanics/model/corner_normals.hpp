#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <cstddef>
#include <vector>

namespace tunica {

/// The corners' own normals, or those of the vertices where a mesh has none (`curved` false: flat facets).
/// Errors: InputError: as require_valid() of what it takes them from.
class CornerNormals {
public:
  CornerNormals(const ShellMesh& mesh, bool curved) : mesh_(mesh) {
    if (!curved || (mesh.corner_normals.empty() && mesh.normals.size() != mesh.vertices.size())) {
      of_vertices_ = vertex_normals(flat_facets(mesh));  // which asks the same of its mesh
    } else {
      require_valid(mesh);
    }
  }

  [[nodiscard]] Vec3 operator()(std::size_t triangle, std::size_t corner) const {
    return of_vertices_.empty() ? mesh_.normal(triangle, corner) : of_vertices_[mesh_.triangles[triangle][corner]];
  }

private:
  const ShellMesh& mesh_;
  std::vector<Vec3> of_vertices_;
};

}  // namespace tunica
