#include "tunica/mechanics/runs/drawn_state.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/contact/rigid_surface.hpp"
#include "tunica/mechanics/runs/result_grid.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

// Largest stretch of each tetrahedron less one, as means at the nodes by volume.
void add_solid_strain(const SolidBody& solid, const Vec3* displacement, double* of_nodes) {
  const TetMesh& mesh = solid.mesh;
  std::vector<double> volumes(mesh.vertices.size(), 0);
  for (const auto& nodes : mesh.tetrahedra) {
    Mat3 before;
    Mat3 after;
    for (int k = 0; k < 3; ++k) {
      before.col(k) = mesh.vertices[nodes[k + 1]] - mesh.vertices[nodes[0]];
      after.col(k) = before.col(k) + displacement[nodes[k + 1]] - displacement[nodes[0]];
    }
    const double strain = Eigen::JacobiSVD<Mat3>(after * before.inverse()).singularValues()[0] - 1;
    for (const Index node : nodes) {
      of_nodes[node] += before.determinant() * strain;
      volumes[node] += before.determinant();
    }
  }
  for (std::size_t v = 0; v < volumes.size(); ++v) {
    of_nodes[v] = volumes[v] > 0 ? std::max(0.0, of_nodes[v] / volumes[v]) : 0;
  }
}

std::vector<double> strain_at_nodes(const Model& model, const State& state, const ElementFields& fields) {
  std::vector<double> strain = fields.strain;
  strain.resize(model.node_count(), 0);
  for (double& value : strain) {
    value = std::max(value, 0.0);
  }
  for (std::size_t s = 0; s < model.solids.size(); ++s) {
    const std::size_t first = model.first_node(model.shells.size() + s);
    add_solid_strain(model.solids[s], state.displacement.data() + first, strain.data() + first);
  }
  return strain;
}

}  // namespace

DrawnState drawn_state(const Model& model, const State& state, const ElementFields& fields, Colouring colour) {
  TUNICA_ASSERT(model.body_count() > 0);
  const ResultGrid grid(model, 0);
  const std::vector<Floats> of_points = grid.values(state, fields);
  DrawnState drawn{grid.surface(), {}, grid.shell_edges(), {}, {}};
  for (std::size_t t = 0; t < grid.tetrahedra(); ++t) {
    const auto corner = grid.connectivity().begin() + narrow<std::ptrdiff_t>(3 * grid.triangles() + 4 * t);
    std::ranges::copy(corner, corner + 4, drawn.tetrahedra.emplace_back().begin());
  }
  for (std::size_t p = 0; p < grid.points(); ++p) {
    drawn.displacement.emplace_back(of_points[0][3 * p], of_points[0][3 * p + 1], of_points[0][3 * p + 2]);
  }
  switch (colour) {
    case Colouring::displacement:
      for (std::size_t p = 0; p < grid.points(); ++p) {
        drawn.values.push_back(std::hypot(of_points[0][3 * p], of_points[0][3 * p + 1], of_points[0][3 * p + 2]));
      }
      break;
    case Colouring::strain: {
      const Floats strain = grid.at_points(strain_at_nodes(model, state, fields));
      drawn.values.assign(strain.begin(), strain.end());
      break;
    }
    case Colouring::membrane:
      drawn.values.assign(of_points[2].begin(), of_points[2].end());
      break;
    case Colouring::stress:
      drawn.values.assign(of_points[3].begin(), of_points[3].end());
      break;
  }
  return drawn;
}

TriangleMesh drawn_rigids(const Model& model, double time, const Vec3& near, double reach) {
  TriangleMesh all;
  for (const RigidBody& body : model.rigids) {
    const TriangleMesh one = rigid_surface(body, time, near, reach);
    const auto first = narrow<Index>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), one.vertices.begin(), one.vertices.end());
    for (const auto& [a, b, c] : one.triangles) {
      all.triangles.push_back({first + a, first + b, first + c});
    }
  }
  return all;
}

}  // namespace tunica
