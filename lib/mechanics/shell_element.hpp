#pragma once

#include "mechanics/element_stiffness.hpp"

#include <Eigen/Geometry>

/// One co-rotational shell triangle: its reference, its energy, and the first and second derivatives of the energy.
///
/// The frame follows the triangle by the rotation of its in-plane deformation gradient, so nothing depends on the
/// order of the corners. What is left of displacements and rotations in that frame, the deformation
///   d = (in-plane corner displacements, rotation vectors of the corners relative to the frame),
/// has the energy d'Kd/2 with the linear stiffness K. Forces are its gradient to the last term, and the tangent the
/// gradient of the forces.
/// Source: Nour-Omid, Rankin 1991; Felippa, Haugen 2005; Battini 2007.
namespace tunica {

using Vector18 = Eigen::Matrix<double, 18, 1>;
using Matrix18 = Eigen::Matrix<double, 18, 18>;
using Mat23 = Eigen::Matrix<double, 2, 3>;

struct ShellElement {
  std::array<Index, 3> nodes{};  ///< global
  std::size_t body = 0;
  double thickness = 0;
  double area = 0;           ///< of the reference facet
  Mat3 axes;                 ///< rows: the reference frame; x along the first edge, z along the facet's normal
  Mat3 from_centroid;        ///< columns: corners minus centroid, reference
  Mat23 plane;               ///< columns: the same in the reference frame
  Mat23 gradients;           ///< columns: gradients of the barycentric coordinates
  Matrix9 membrane;          ///< (u, v, theta_z) per corner
  Matrix9 bending;           ///< (w, theta_x, theta_y) per corner
  Matrix39 membrane_strain;  ///< mean, from the membrane freedoms
  Matrix39 curvature;        ///< mean, from the bending freedoms
};

/// What the three corners do: displacements (columns) and rotations from the reference.
struct CornerMotion {
  Mat3 displacement;
  std::array<Mat3, 3> rotation;
};

/// Geometry, stiffness and strain operators. `higher_order_scale` goes to membrane_opt().
ShellElement make_shell_element(const std::array<Vec3, 3>& corners, const Material& material, double thickness,
                                Membrane membrane, Bending bending, double higher_order_scale);

/// Deformation in the element's frame: (u, v, 0, theta) per corner. Zero, to the last bit, at the reference.
/// @return false when the triangle has collapsed or turned inside out: no frame exists.
bool deformation(const ShellElement& element, const CornerMotion& motion, Vector18& result);

/// Stiffness times a deformation.
Vector18 element_force(const ShellElement& element, const Vector18& deformation);

/// The linear stiffness in world axes, at the reference.
Matrix18 linear_stiffness(const ShellElement& element);

struct ElementResponse {
  Vector18 deformation;
  Vector18 force;  ///< world axes, conjugate to displacements and spins
  double energy = 0;
};

/// Stiffness-proportional damping in the element's own frame, so that rigid rotations are not damped: the deformation
/// d gets the viscous part `factor` (d - previous), with factor = beta / dt.
struct Viscous {
  double factor = 0;
  const Vector18* previous = nullptr;
};

/// Forces, and the tangent when asked for: d force / d (displacement, spin), not symmetric away from equilibrium.
/// @return false as deformation() does.
/// Cost: about 2 us with the tangent, 0.5 us without; no allocation.
bool corotational_response(const ShellElement& element, const CornerMotion& motion, const Viscous& viscous,
                           ElementResponse& response, Matrix18* tangent);

/// Strain energy of a deformation.
double strain_energy(const ShellElement& element, const Vector18& deformation);

}  // namespace tunica
