#include "tunica/mechanics/elements/element_stiffness.hpp"

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

MembraneStiffness membrane_cst(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness) {
  const double volume = triangle.a * triangle.h / 2 * thickness;
  return {volume * elasticity, Mat3::Zero(), drilling * volume * 2 * elasticity(2, 2) * Mat3::Identity()};
}

}  // namespace tunica
