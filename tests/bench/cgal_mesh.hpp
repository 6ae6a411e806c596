#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <CGAL/Surface_mesh.h>

namespace tunica {

/// A manifold mesh as CGAL's, of whatever kernel; vertices and faces keep their order.
template <typename CgalMesh>
CgalMesh to_cgal(const TriangleMesh& mesh) {
  CgalMesh result;
  for (const Vec3& v : mesh.vertices) {
    result.add_vertex({v.x(), v.y(), v.z()});
  }
  const auto vertex = [](Index i) { return typename CgalMesh::Vertex_index(i); };
  for (const auto& [i, j, k] : mesh.triangles) {
    result.add_face(vertex(i), vertex(j), vertex(k));
  }
  return result;
}

}  // namespace tunica
