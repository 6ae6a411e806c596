// Batoz, Bathe, Ho 1980, "A study of three-node triangular plate bending elements", Int. J. Numer. Meth. Engrg. 15.

#include "tunica/mechanics/elements/element_stiffness.hpp"

namespace tunica {

PlaneStiffness bending_dkt(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  using Slope = Eigen::Matrix<double, 2, 9>;  // (w_x, w_y) from the nodal freedoms
  const auto corners = corner_matrix(triangle);
  const auto gradients = barycentric_gradients(triangle);
  const double area = triangle.a * triangle.h / 2;

  // The slopes at the corners are freedoms; at an edge's middle the slope along the edge is that of the cubic, the
  // slope across it the mean. Inside they are quadratic.
  std::array<Slope, 6> slopes;
  for (int k = 0; k < 3; ++k) {
    Slope& slope = slopes[k];
    slope.setZero();
    slope(0, 3 * k + 2) = -1;
    slope(1, 3 * k + 1) = 1;
  }
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const Vec2 edge = corners.col(j) - corners.col(i);
    const double length = edge.norm();
    const Vec2 tangent = edge / length;
    const Vec2 normal(-tangent.y(), tangent.x());
    const Slope sum = slopes[i] + slopes[j];
    Vector9 along = -0.25 * sum.transpose() * tangent;
    along[3 * j] += 1.5 / length;
    along[3 * i] -= 1.5 / length;
    const Vector9 across = 0.5 * sum.transpose() * normal;
    slopes[3 + i] = tangent * along.transpose() + normal * across.transpose();
  }

  const Mat3 rigidity = elasticity * (thickness * thickness * thickness / 12);
  PlaneStiffness result{Matrix9::Zero(), Matrix39::Zero()};
  for (int point = 0; point < 3; ++point) {  // the middles of the edges: exact, as curvatures are linear
    std::array<double, 3> barycentric{0.5, 0.5, 0.5};
    barycentric[(point + 2) % 3] = 0;
    Matrix39 curvature = Matrix39::Zero();
    const auto add = [&](const Vec2& gradient, const Slope& slope) {
      curvature.row(0) -= gradient.x() * slope.row(0);
      curvature.row(1) -= gradient.y() * slope.row(1);
      curvature.row(2) -= gradient.y() * slope.row(0) + gradient.x() * slope.row(1);
    };
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3;
      const double li = barycentric[i];
      const double lj = barycentric[j];
      add((4 * li - 1) * gradients.col(i), slopes[i]);
      add(4 * (li * gradients.col(j) + lj * gradients.col(i)), slopes[3 + i]);
    }
    result.stiffness += area / 3 * curvature.transpose() * rigidity * curvature;
    result.mean_strain += curvature / 3;
  }
  return result;
}

PlaneStiffness bending_dkt_comas(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  constexpr double share = 0.2;
  PlaneStiffness result = bending_dkt(triangle, elasticity, thickness);
  const PlaneStiffness cubic = bending_comas_consistent(triangle, elasticity, thickness);
  result.stiffness = (1 - share) * result.stiffness + share * cubic.stiffness;
  result.mean_strain = (1 - share) * result.mean_strain + share * cubic.mean_strain;
  return result;
}

}  // namespace tunica
