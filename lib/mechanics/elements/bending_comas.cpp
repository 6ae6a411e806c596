// The paper's bending element and its repair. Both take the cubic from lib/shell/shape_function.

#include "tunica/mechanics/elements/element_stiffness.hpp"

namespace tunica {
namespace {

/// Curvatures -(w_xx, w_yy, 2 w_xy) of the cubic at the middles of the edges: w'' is linear, so that these three
/// points integrate its square exactly.
std::array<Matrix39, 3> edge_middle_curvatures(const PlaneTriangle& triangle) {
  const Matrix9 inverse = inverse_shape_matrix(triangle);
  const auto corners = corner_matrix(triangle);
  std::array<Matrix39, 3> curvatures;
  for (int k = 0; k < 3; ++k) {
    const Vec2 middle = (corners.col(k) + corners.col((k + 1) % 3)) / 2;
    Matrix39 second;
    second.row(0) = -monomials_dxx(middle.x(), middle.y()).transpose();
    second.row(1) = -monomials_dyy(middle.x(), middle.y()).transpose();
    second.row(2) = -2 * monomials_dxy(middle.x(), middle.y()).transpose();
    curvatures[k] = second * inverse;
  }
  return curvatures;
}

/// The mean curvature by the divergence theorem, -(1/A) times the integral of n x slope around the triangle: w is cubic
/// along an edge, so its slope along the edge integrates to the difference of w; the slope across is linear.
Matrix39 boundary_curvature(const PlaneTriangle& triangle) {
  const auto corners = corner_matrix(triangle);
  Matrix39 curvature = Matrix39::Zero();
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const Vec2 edge = corners.col(j) - corners.col(i);
    const Vec2 tangent = edge.normalized();
    const Vec2 normal(tangent.y(), -tangent.x());
    Eigen::Matrix<double, 2, 9> slope = Eigen::Matrix<double, 2, 9>::Zero();  // integrated over the edge
    slope.col(3 * j) += tangent;
    slope.col(3 * i) -= tangent;
    for (const int k : {i, j}) {
      // dw/dn = n_x w_x + n_y w_y with w_x = -theta_y and w_y = theta_x
      slope.col(3 * k + 1) += edge.norm() / 2 * normal.y() * normal;
      slope.col(3 * k + 2) -= edge.norm() / 2 * normal.x() * normal;
    }
    curvature.row(0) -= normal.x() * slope.row(0);
    curvature.row(1) -= normal.y() * slope.row(1);
    curvature.row(2) -= normal.y() * slope.row(0) + normal.x() * slope.row(1);
  }
  return curvature / (triangle.a * triangle.h / 2);
}

Matrix9 integrate(const std::array<Matrix39, 3>& curvatures, const Mat3& rigidity, double area) {
  Matrix9 stiffness = Matrix9::Zero();
  for (const Matrix39& b : curvatures) {
    stiffness += area / 3 * b.transpose() * rigidity * b;
  }
  return stiffness;
}

}  // namespace

PlaneStiffness bending_comas(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  const Mat3 rigidity = elasticity * (thickness * thickness * thickness / 12);
  const auto curvatures = edge_middle_curvatures(triangle);
  return {integrate(curvatures, rigidity, triangle.a * triangle.h / 2),
          (curvatures[0] + curvatures[1] + curvatures[2]) / 3};
}

PlaneStiffness bending_comas_consistent(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  const Mat3 rigidity = elasticity * (thickness * thickness * thickness / 12);
  const auto corners = corner_matrix(triangle);
  const double area = triangle.a * triangle.h / 2;
  PlaneStiffness result{Matrix9::Zero(), boundary_curvature(triangle)};
  for (int first = 0; first < 3; ++first) {
    // The triangle with corner `first` at its origin and its x axis along the edge that starts there.
    const int second = (first + 1) % 3;
    const int third = (first + 2) % 3;
    const Vec2 e1 = (corners.col(second) - corners.col(first)).normalized();
    const Vec2 e2(-e1.y(), e1.x());
    const Vec2 to_third = corners.col(third) - corners.col(first);
    const PlaneTriangle turned{(corners.col(second) - corners.col(first)).norm(), e1.dot(to_third), e2.dot(to_third)};
    auto curvatures = edge_middle_curvatures(turned);
    const Matrix39 mean = (curvatures[0] + curvatures[1] + curvatures[2]) / 3;
    const Matrix39 boundary = boundary_curvature(turned);
    for (Matrix39& b : curvatures) {
      b += boundary - mean;
    }
    // Isotropic, so the elasticity is the same in both frames.
    const Matrix9 stiffness = integrate(curvatures, rigidity, area);
    Matrix9 turn = Matrix9::Zero();
    for (int k = 0; k < 3; ++k) {
      const int corner = (first + k) % 3;
      turn(3 * k, 3 * corner) = 1;
      turn.block<1, 2>(3 * k + 1, 3 * corner + 1) = e1.transpose();
      turn.block<1, 2>(3 * k + 2, 3 * corner + 1) = e2.transpose();
    }
    result.stiffness += turn.transpose() * stiffness * turn / 3;
  }
  return result;
}

}  // namespace tunica
