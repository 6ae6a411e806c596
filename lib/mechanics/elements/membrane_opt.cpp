// Felippa 2003, "A study of optimal membrane triangles with drilling freedoms", Comput. Methods Appl. Mech. Engrg. 192.

#include "tunica/mechanics/elements/element_stiffness.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double alpha = 1.5;  // of the basic stiffness
/// beta_1 ... beta_9 of the higher-order part.
constexpr std::array<double, 9> beta{1, 2, 1, 0, 1, -1, -1, -1, -2};

}  // namespace

MembraneStiffness membrane_opt(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness,
                               double higher_order_scale) {
  const auto corners = corner_matrix(triangle);
  const double area = triangle.a * triangle.h / 2;
  const auto x = [&](int i, int j) { return corners(0, i - 1) - corners(0, j - 1); };
  const auto y = [&](int i, int j) { return corners(1, i - 1) - corners(1, j - 1); };

  // Lumping matrix, eq. 21, gathered by edges: what the rotations at the ends of an edge differ by bows it.
  MembraneStiffness result;
  result.basic = area * thickness * elasticity;
  for (int k = 0; k < 3; ++k) {
    const Vec2 edge = corners.col((k + 1) % 3) - corners.col(k);
    result.bow.col(k) = alpha / (12 * area) * Vec3(edge.y() * edge.y(), edge.x() * edge.x(), -2 * edge.x() * edge.y());
  }

  // Natural strains along the three edges (eq. 24), and the energy in terms of them.
  const double l21 = x(2, 1) * x(2, 1) + y(2, 1) * y(2, 1);
  const double l32 = x(3, 2) * x(3, 2) + y(3, 2) * y(3, 2);
  const double l13 = x(1, 3) * x(1, 3) + y(1, 3) * y(1, 3);
  Mat3 natural;
  natural << y(2, 3) * y(1, 3) * l21, y(3, 1) * y(2, 1) * l32, y(1, 2) * y(3, 2) * l13,  //
      x(2, 3) * x(1, 3) * l21, x(3, 1) * x(2, 1) * l32, x(1, 2) * x(3, 2) * l13,         //
      (y(2, 3) * x(3, 1) + x(3, 2) * y(1, 3)) * l21, (y(3, 1) * x(1, 2) + x(1, 3) * y(2, 1)) * l32,
      (y(1, 2) * x(2, 3) + x(2, 1) * y(3, 2)) * l13;
  natural /= 4 * area * area;
  const Mat3 natural_elasticity = natural.transpose() * elasticity * natural;

  // Eq. 26: natural strains at the corners from the rotations left after the mean one is taken away.
  const auto corner_strain = [&](std::array<int, 9> order) {
    Mat3 q;
    for (int column = 0; column < 3; ++column) {
      q(0, column) = beta[order[column] - 1] / l21;
      q(1, column) = beta[order[column + 3] - 1] / l32;
      q(2, column) = beta[order[column + 6] - 1] / l13;
    }
    return Mat3(q * (2 * area / 3));
  };
  const Mat3 q1 = corner_strain({1, 2, 3, 4, 5, 6, 7, 8, 9});
  const Mat3 q2 = corner_strain({9, 7, 8, 3, 1, 2, 6, 4, 5});
  const Mat3 q3 = corner_strain({5, 6, 4, 8, 9, 7, 2, 3, 1});
  Mat3 hierarchical = Mat3::Zero();
  for (const Mat3& q : {Mat3((q1 + q2) / 2), Mat3((q2 + q3) / 2), Mat3((q3 + q1) / 2)}) {
    hierarchical += q.transpose() * natural_elasticity * q;
  }
  // The optimal beta_0 depends on Poisson's ratio, which plane stress holds as D12 / D11.
  const double nu = elasticity(0, 1) / elasticity(0, 0);
  const double beta_0 = std::max(0.5 * (1 - 4 * nu * nu), 0.01);
  result.higher_order = higher_order_scale * 0.75 * beta_0 * area * thickness * hierarchical;
  return result;
}

double adapted_scale(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& nodal_normals, double thickness) {
  double bulge = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    bulge = std::max(bulge, std::abs((nodal_normals[j] - nodal_normals[i]).dot(corners[j] - corners[i])));
  }
  const double ratio = 3 * bulge / thickness;
  return std::max(1 / (1 + ratio * ratio), 1e-4);
}

}  // namespace tunica
