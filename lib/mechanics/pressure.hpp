#pragma once

#include "core/types.hpp"

/// Pressure on the curved patch of a triangle, derived from the volume it adds: force = pressure x gradient of volume.
///
/// The volume between the patch and its facet is the integral of w, and that is invariant under rigid motions: its
/// gradient is in balance by itself, triangle by triangle. What the facets enclose adds p A n / 3 at each corner,
/// which is in balance on a closed surface. So uniform pressure on a closed shell has no net force and no net moment.
namespace tunica {

/// Variables: corners x1, x2, x3, then normals N1, N2, N3.
using Vector18 = Eigen::Matrix<double, 18, 1>;
using Matrix18 = Eigen::Matrix<double, 18, 18>;

/// Volume between the comas patch (averaged over the three choices of the first vertex) and its facet, with gradient
/// and, when asked for, Hessian by (x1, x2, x3, N1, N2, N3).
/// The normals need not be unit vectors; only their directions count.
/// @return false when a normal is nearly in the facet's plane (N.n < 0.05): there is no patch.
bool patch_volume(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals, double& volume,
                  Vector18& gradient, Matrix18* hessian);

/// Forces of a unit follower pressure (N per MPa), ordered (force, moment) per corner, world axes, when the normals
/// turn with the nodes; the load stiffness d force / d (displacement, spin) when asked for.
/// @return false as patch_volume() does.
bool unit_pressure(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals, Vector18& force,
                   Matrix18* stiffness);

}  // namespace tunica
