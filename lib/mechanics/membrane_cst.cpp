#include "mechanics/element_stiffness.hpp"

namespace tunica {
namespace {

/// Times E t A per corner. 1e-2 would make a thin hemisphere 25 % too stiff; this is invisible there.
constexpr double drilling = 1e-4;

}  // namespace

Mat3 plane_stress(const Material& material) {
  const double nu = material.poisson;
  const double factor = material.young / (1 - nu * nu);
  return factor * (Mat3() << 1, nu, 0, nu, 1, 0, 0, 0, (1 - nu) / 2).finished();
}

PlaneStiffness membrane_cst(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  const auto g = barycentric_gradients(triangle);
  const double area = triangle.a * triangle.h / 2;
  PlaneStiffness result;
  result.mean_strain.setZero();
  Vector9 spin = Vector9::Zero();  // (dv/dx - du/dy) / 2
  for (int k = 0; k < 3; ++k) {
    result.mean_strain.col(3 * k) << g(0, k), 0, g(1, k);
    result.mean_strain.col(3 * k + 1) << 0, g(1, k), g(0, k);
    spin[3 * k] = -g(1, k) / 2;
    spin[3 * k + 1] = g(0, k) / 2;
  }
  result.stiffness = area * thickness * result.mean_strain.transpose() * elasticity * result.mean_strain;
  const double tie = drilling * area * thickness * 2 * elasticity(2, 2);
  for (int k = 0; k < 3; ++k) {
    Vector9 difference = -spin;
    difference[3 * k + 2] += 1;
    result.stiffness += tie * difference * difference.transpose();
  }
  return result;
}

}  // namespace tunica
