#pragma once

#include "tunica/mechanics/elements/shell_element.hpp"

/// Follower pressure on curved triangles: pressure times the gradient of the enclosed volume.
///
/// What the facets enclose adds p A n / 3 at each corner; on a closed surface that is in balance. What lies between a
/// facet and its curved patch is invariant under rigid motions, so that its gradient is in balance by itself. Uniform
/// pressure on a closed shell thus has no net force and no net moment, in any configuration, and its stiffness is
/// symmetric away from free edges.
///
/// Where the shell's slopes count in its membrane strain the patch follows them, and its pressure works on the nodes'
/// rotations. Where they do not, the rotations of a thin shell are held by little more than its bending stiffness, and
/// pressure would bulge such patches at no cost in membrane energy (a spurious instability from strains of
/// (t R / h^2)^2 on): there the height follows the stretch of the facet alone.
namespace tunica {

/// Mean height of a patch over its facet as a function of the corners: (constant + sum_kl coupling_kl x_k.x_l) / 2.
/// Exact at the reference; to first order the slopes at the corners stay what they were.
struct PatchHeight {
  double constant = 0;           ///< mm
  Mat3 coupling = Mat3::Zero();  ///< 1/mm; rows and columns add up to zero
};

/// Of the comas patch (averaged over the three choices of the first vertex) with these unit normals.
/// Limits: N.n > 0, which check_model() asks for.
PatchHeight patch_height(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals);

/// Volume between patch and facet.
double patch_volume(const std::array<Vec3, 3>& corners, const PatchHeight& height);

/// Forces of a unit follower pressure (N per MPa) on the three corners, and d force / d corners when asked for.
void unit_pressure(const std::array<Vec3, 3>& corners, const PatchHeight& height, Vector9& force, Matrix9* stiffness);

/// The same on an element whose slopes count (ShellElement::curved): forces and moments, and their derivative by
/// displacements and spins. `volume`, where asked for, is that between patch and facet.
void unit_pressure(const ShellElement& element, const CornerMotion& motion, Vector18& force, Matrix18* stiffness,
                   double* volume = nullptr);

/// Work-equivalent nodal loads of a unit pressure on the cubic deflection over a flat facet: forces along the normal,
/// and vectors g in the facet such that a corner's normal N does the work g.N.
struct PlateLoad {
  std::array<double, 3> force{};
  std::array<Vec3, 3> director;
};
PlateLoad plate_load(const std::array<Vec3, 3>& corners);

}  // namespace tunica
