#include "tunica/mechanics/model/curvature.hpp"

#include "tunica/mechanics/model/corner_normals.hpp"

#include <Eigen/Dense>

#include <cmath>

namespace tunica {
namespace {

/// In the plane of a facet with the axes x and y: xx, xy, yy.
Vec3 shape_in_plane(const ShellMesh& mesh, const CornerNormals& normal, std::size_t triangle, const Vec3& x,
                    const Vec3& y) {
  const auto& v = mesh.triangles[triangle];
  Mat3 left = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 edge = mesh.vertices[v[(k + 1) % 3]] - mesh.vertices[v[k]];
    const Vec3 turn = normal(triangle, (k + 1) % 3) - normal(triangle, k);
    const double u = edge.dot(x);
    const double w = edge.dot(y);
    Eigen::Matrix<double, 2, 3> rows;
    rows << u, w, 0, 0, u, w;
    left += rows.transpose() * rows;
    right += rows.transpose() * Vec2(turn.dot(x), turn.dot(y));
  }
  return left.ldlt().solve(right);
}

}  // namespace

std::vector<Mat3> shape_operators_of(const ShellMesh& mesh, bool curved) {
  const CornerNormals normal(mesh, curved);
  std::vector<Mat3> shapes(mesh.triangles.size(), Mat3::Zero());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& v = mesh.triangles[t];
    const Vec3 along = mesh.vertices[v[1]] - mesh.vertices[v[0]];
    const Vec3 across = along.cross(mesh.vertices[v[2]] - mesh.vertices[v[0]]);
    if (!(across.norm() > 0)) {
      continue;
    }
    const Vec3 x = along.normalized();
    const Vec3 y = across.cross(along).normalized();
    const Vec3 shape = shape_in_plane(mesh, normal, t, x, y);
    shapes[t] = shape[0] * x * x.transpose() + shape[1] * (x * y.transpose() + y * x.transpose()) +
                shape[2] * y * y.transpose();
  }
  return shapes;
}

std::vector<Curvature> curvatures_of(const ShellMesh& mesh, bool curved) {
  std::vector<Curvature> curvatures;
  curvatures.reserve(mesh.triangles.size());
  for (const Mat3& shape : shape_operators_of(mesh, curved)) {
    // Of the two principal curvatures, by their sum and the sum of their squares; the third eigenvalue is zero.
    const double sum = shape.trace();
    const double difference = std::sqrt(std::max(0.0, 2 * shape.squaredNorm() - sum * sum));
    curvatures.push_back({(std::abs(sum) + difference) / 2, sum});
  }
  return curvatures;
}

}  // namespace tunica
