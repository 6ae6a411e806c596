// Where the vertices of a shaped mesh may go: by least squares, along the boundary, between two others.
#include "tunica/surface/decimation/detail/shape_patch.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {

struct ShapedMesh::LeastSquares {
  Mat3 matrix = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  Vec3 centre = Vec3::Zero();
  double area = 0;

  // Weights of the corners at the point of a triangle closest to p.
  static Vec3 barycentric(const Vec3& point, const std::array<Vec3, 3>& c) {
    const Vec3 n = area_vector(c);
    const double squared = n.squaredNorm();
    if (!(squared > 0)) {
      return Vec3::Constant(1.0 / 3);
    }
    return {n.dot((c[1] - point).cross(c[2] - point)) / squared, n.dot((c[2] - point).cross(c[0] - point)) / squared,
            n.dot((c[0] - point).cross(c[1] - point)) / squared};
  }

  // A triangle with the vertex at corner k.
  void add_triangle(const std::array<Vec3, 3>& c) {
    const double weight = area_vector(c).norm();
    centre += weight * (c[0] + c[1] + c[2]) / 3;
    area += weight;
  }

  void add_sample(const Vec3& p, const std::array<Vec3, 3>& c, std::size_t k, double large) {
    const Vec3 x = closest_point_on_triangle(p, c[0], c[1], c[2]);
    const double share = barycentric(x, c)[k];
    const Vec3 residual = p - x;
    const Vec3 normal = area_vector(c).normalized();
    const double off = residual.norm();
    // Beside the triangle's plane only by its edge: then the direction is that of the residual.
    const Vec3 direction = std::abs(normal.dot(residual)) > 0.5 * off ? normal : Vec3(residual / off);
    const double relative = off / large;
    const double weight = share * (0.05 + relative * relative);
    matrix += weight * share * direction * direction.transpose();
    right += weight * direction.dot(residual) * direction;
  }

  [[nodiscard]] Vec3 solve(const Vec3& from, double pull) const {
    if (!(area > 0)) {
      return from;
    }
    const double shift = pull * std::max(matrix.trace(), std::numeric_limits<double>::min());
    const Mat3 shifted = matrix + shift * Mat3::Identity();
    const Vec3 step = shifted.ldlt().solve(right + shift * (centre / area - from));
    return step.allFinite() ? Vec3(from + step) : from;
  }
};

Vec3 ShapedMesh::proposal(Index vertex, double pull) const {
  LeastSquares fit;
  for (const Index t : mesh_.around[vertex]) {
    const auto c = corners(mesh_.triangles[t], {});
    fit.add_triangle(c);
    for (const Index s : states_[t].samples) {
      fit.add_sample(sample_[s], c, mesh_.corner_of(t, vertex), weights_.error);
    }
  }
  return fit.solve(mesh_.positions[vertex], pull);
}

Vec3 ShapedMesh::proposal(const PatchTrial& trial, double pull) const {
  LeastSquares fit;
  const auto corner = [&](std::size_t i) {
    const auto& c = trial.corners[i];
    return std::find(c.begin(), c.end(), trial.moved) - c.begin();
  };
  for (const auto& triangle : trial.corners) {
    fit.add_triangle(corners(triangle, trial));
  }
  for (std::size_t s = 0; s < trial.samples.size(); ++s) {
    const std::size_t i = trial.owner[s];
    if (corner(i) < 3) {
      fit.add_sample(sample_[trial.samples[s]], corners(trial.corners[i], trial), corner(i), weights_.error);
    }
  }
  return fit.solve(trial.position, pull);
}

Vec3 ShapedMesh::slide(Index vertex, double fraction) const {
  Index before = EditMesh::none;
  Index after = EditMesh::none;
  for (const Index t : mesh_.around[vertex]) {
    const auto& c = mesh_.triangles[t];
    const std::size_t k = mesh_.corner_of(t, vertex);
    if (mesh_.on_edge(vertex, c[(k + 1) % 3])[1] == EditMesh::none) {
      after = c[(k + 1) % 3];
    }
    if (mesh_.on_edge(c[(k + 2) % 3], vertex)[1] == EditMesh::none) {
      before = c[(k + 2) % 3];
    }
  }
  if (before == EditMesh::none || after == EditMesh::none) {
    return mesh_.positions[vertex];
  }
  return curves_.point(curves_.between(places_[before], places_[after], fraction));
}

Vec3 ShapedMesh::middle(Index u, Index v) const {
  const auto on = mesh_.on_edge(u, v);
  if (on[0] != EditMesh::none && on[1] != EditMesh::none) {
    const Vec3 x = 0.5 * (mesh_.positions[u] + mesh_.positions[v]);
    return nearest_(x, states_[on[0]].guess, exact).point;
  }
  const bool forward = on[0] != EditMesh::none;  // the triangle, and so the curve, runs from u to v
  return curves_.point(curves_.between(places_[forward ? u : v], places_[forward ? v : u], 0.5));
}

}  // namespace tunica
