#pragma once

#include "benchmarks.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

/// Meshes of tetrahedra and models of one solid that the tests share.
namespace tunica::benchmarks {

/// Layers of prisms over a triangulation, each cut into three tetrahedra by the order of the nodes, so that neighbours
/// fit. `place` says where node `v` of the triangulation is at `w`, 0 ... 1 through the layers; the node of layer k is
/// k x nodes + v.
inline TetMesh extrude(const std::vector<std::array<Index, 3>>& triangles, std::size_t nodes, std::size_t layers,
                       const std::function<Vec3(Index v, double w)>& place) {
  TetMesh mesh;
  for (std::size_t k = 0; k <= layers; ++k) {
    for (std::size_t v = 0; v < nodes; ++v) {
      mesh.vertices.push_back(place(static_cast<Index>(v), static_cast<double>(k) / static_cast<double>(layers)));
    }
  }
  for (std::size_t k = 0; k < layers; ++k) {
    for (std::array<Index, 3> t : triangles) {
      std::sort(t.begin(), t.end());
      const auto lower = static_cast<Index>(k * nodes), upper = static_cast<Index>((k + 1) * nodes);
      const Index a = lower + t[0], b = lower + t[1], c = lower + t[2];
      const Index a1 = upper + t[0], b1 = upper + t[1], c1 = upper + t[2];
      for (std::array<Index, 4> tet : {std::array{a, b, c, c1}, std::array{a, b, b1, c1}, std::array{a, a1, b1, c1}}) {
        const auto& x = mesh.vertices;
        if ((x[tet[1]] - x[tet[0]]).dot((x[tet[2]] - x[tet[0]]).cross(x[tet[3]] - x[tet[0]])) < 0) {
          std::swap(tet[2], tet[3]);
        }
        mesh.tetrahedra.push_back(tet);
      }
    }
  }
  return mesh;
}

/// nx x ny x nz cells over the unit cube, mapped.
inline TetMesh make_block(std::size_t nx, std::size_t ny, std::size_t nz, const std::function<Vec3(const Vec3&)>& map,
                          Diagonals diagonals = Diagonals::alternating) {
  const Grid grid = make_grid(
      nx, ny, [](double u, double v) { return Vec3(u, v, 0); }, diagonals);
  return extrude(grid.mesh.triangles, grid.mesh.vertices.size(), nz,
                 [&](Index v, double w) { return map(grid.mesh.vertices[v] + Vec3(0, 0, w)); });
}

/// The surface of a cube of n^3 cells about the origin.
inline ShellMesh make_box(std::size_t n, double side) {
  const TetMesh block = make_block(n, n, n, [side](const Vec3& p) { return Vec3(side * (p - Vec3::Constant(0.5))); });
  TriangleMesh surface = without_unused({block.vertices, boundary_triangles(block)});
  ShellMesh mesh;
  mesh.vertices = std::move(surface.vertices);
  mesh.triangles = std::move(surface.triangles);
  return mesh;
}

inline Model one_solid(TetMesh mesh, double young, double poisson, SolidLaw law = SolidLaw::corotational) {
  Model model;
  model.solids.push_back({"solid", std::move(mesh), {young, poisson, std::nullopt}, law});
  return model;
}

/// Nodes of a body, by their reference.
inline std::vector<Index> nodes_of(const Model& model, std::size_t body,
                                   const std::function<bool(const Vec3&)>& condition) {
  std::vector<Index> nodes;
  const std::vector<Vec3>& vertices = model.vertices_of(body);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (condition(vertices[i])) {
      nodes.push_back(static_cast<Index>(i));
    }
  }
  return nodes;
}

/// Holds the components of `translation` ("xyz") of the nodes of a body where the condition holds.
inline void hold_nodes(Model& model, std::size_t body, const std::function<bool(const Vec3&)>& condition,
                       const std::string& translation) {
  Fix fix;
  fix.body = body;
  fix.nodes = nodes_of(model, body, condition);
  for (std::size_t c = 0; c < 3; ++c) {
    fix.translation[c] = translation.find("xyz"[c]) != std::string::npos;
    fix.rotation[c] = false;
  }
  model.fixes.push_back(fix);
}

/// Moves the nodes of a body where the condition holds, their rotations free.
inline void move_nodes(Model& model, std::size_t body, const std::function<bool(const Vec3&)>& condition,
                       const std::function<Vec3(const Vec3&)>& displacement) {
  for (const Index i : nodes_of(model, body, condition)) {
    Fix fix;
    fix.body = body;
    fix.nodes = {i};
    fix.rotation = {false, false, false};
    fix.displacement = displacement(model.vertices_of(body)[i]);
    model.fixes.push_back(fix);
  }
}

}  // namespace tunica::benchmarks
