// mechanics/solids: linear tetrahedra.
#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <Eigen/Core>

/// One linear tetrahedron with a linear pressure, continuous over the body, beside its displacement, so that it does
/// not lock where the material hardly changes its volume:
///   L(u, p) = V (W(F) + p_mean theta(F)) - sum of p_i M_ij p_j / (2 K1) - sum of p_i S_ij p_j / (2 mu).
/// The bulk modulus K is split: K0 = min(mu, K / 2) stays in W, so that W alone is stable and the tangent
/// quasi-definite in any order of its unknowns (Vanderbei 1995: as many negative pivots as pressures); K1 = K - K0
/// works by the pressure. M is the mass matrix of the linear functions, S = M less that of their mean: it damps what
/// the equal order leaves undetermined, and vanishes for a constant pressure. Pressures are positive in tension, and
/// counted in units of the shear modulus, so that they have no unit and their residual that of a moment.
///   corotational: W = mu |S - 1|^2 + (K0 - 2 mu / 3) tr(S - 1)^2 / 2, F = R S, theta = J - 1 (with tr(S - 1) a
///   pressure
///                 of twice the shear modulus would make any tetrahedron unstable)
///   neo_hookean:  W = mu (|F|^2 - 3) / 2 - mu ln J + (K0 - 2 mu / 3) (ln J)^2 / 2, theta = ln J: no pressure crushes
///   it
///                 to nothing
/// Both are linear elasticity for small strains. Where the reference bears a stress S0 (prestress.hpp), W has
/// S0 : (F'F - 1) / 2 besides.
/// Source: Dohrmann, Bochev 2004, "A stabilized finite element method for the Stokes problem based on polynomial
/// pressure projections"; Bonet, Wood 2008, "Nonlinear continuum mechanics for
/// finite element analysis", section 6.4.3; the derivative of R: McAdams
/// et al. 2011. Limits: a tetrahedron that has turned inside out has no answer. Co-rotational strains should stay below
/// a tenth.
namespace tunica {

using Corners4 = Eigen::Matrix<double, 3, 4>;
using Vector16 = Eigen::Matrix<double, 16, 1>;
using Matrix16 = Eigen::Matrix<double, 16, 16>;

struct SolidElement {
  std::array<Index, 4> nodes{};  ///< global
  std::size_t body = 0;
  SolidLaw law = SolidLaw::corotational;
  double volume = 0;   ///< mm^3
  Corners4 gradients;  ///< columns: of the barycentric coordinates, 1 / mm
  double shear = 0;    ///< MPa
  double bulk_of_displacement = 0;
  double bulk_of_pressure = 0;
  Mat3 prestress = Mat3::Zero();  ///< S0, MPa
};

/// @param corners  columns, mm, in the order of TetMesh
SolidElement make_solid_element(const Corners4& corners, const Material& material, SolidLaw law);

/// Displacements (mm, columns) and pressures (in units of the shear modulus) of the corners.
struct SolidMotion {
  Corners4 displacement;
  Eigen::Vector4d pressure;
};

struct SolidResponse {
  Vector16 force;  ///< per corner: force (N), and the derivative of L by its pressure
  double energy = 0;
};

/// Forces, and their derivative when asked for; it is symmetric.
/// @return false where the tetrahedron has turned inside out
bool solid_response(const SolidElement& element, const SolidMotion& motion, SolidResponse& response, Matrix16* tangent);

/// The tangent at the reference, without what prestress adds.
Matrix16 linear_stiffness(const SolidElement& element);

/// The forces of the linear theory: that stiffness times the motion (displacement and pressure per corner), and those
/// of the prestress.
Vector16 linear_force(const SolidElement& element, const Vector16& motion);

/// Cauchy stress, MPa. Of the linear theory where `linear`.
Mat3 solid_stress(const SolidElement& element, const SolidMotion& motion, bool linear);

}  // namespace tunica
