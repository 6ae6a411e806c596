#pragma once

#include "cgal_mesh.hpp"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_placement.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_plane_policies.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

namespace tunica {

using SimpleCgalMesh = CGAL::Surface_mesh<CGAL::Simple_cartesian<double>::Point_3>;

inline TriangleMesh from_cgal(SimpleCgalMesh& mesh) {
  mesh.collect_garbage();
  TriangleMesh result;
  for (const auto v : mesh.vertices()) {
    const auto& p = mesh.point(v);
    result.vertices.emplace_back(p.x(), p.y(), p.z());
  }
  for (const auto f : mesh.faces()) {
    std::array<Index, 3> corners{};
    std::size_t k = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) {
      corners[k++] = static_cast<Index>(v);
    }
    result.triangles.push_back(corners);
  }
  return result;
}

struct StopAtFaces {
  std::size_t faces;
  template <typename Cost, typename Profile>
  bool operator()(const Cost& /*cost*/, const Profile& profile, std::size_t /*first*/, std::size_t /*edges*/) const {
    return profile.surface_mesh().number_of_faces() <= faces;
  }
};

/// CGAL's Garland-Heckbert planes with its bound on the change of normals, as its manual has it.
inline TriangleMesh garland_heckbert(SimpleCgalMesh mesh, std::size_t triangles) {
  namespace sms = CGAL::Surface_mesh_simplification;
  using Policies = sms::GarlandHeckbert_plane_policies<SimpleCgalMesh, CGAL::Simple_cartesian<double>>;
  const Policies policies(mesh);
  const auto& cost = policies.get_cost();
  const sms::Bounded_normal_change_placement<typename Policies::Get_placement> placement(policies.get_placement());
  sms::edge_collapse(mesh, StopAtFaces{triangles}, CGAL::parameters::get_cost(cost).get_placement(placement));
  return from_cgal(mesh);
}

}  // namespace tunica
