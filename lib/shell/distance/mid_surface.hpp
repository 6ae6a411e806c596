#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

/// From one face of a wall to its middle, where a shell lies.
namespace tunica {

enum class WallFace { outer, inner };

struct MidSurface {
  ShellMesh shell;
  std::vector<double> thickness;  ///< mm, per vertex
};

/// Every node moves half of the thickness along its normal, from the outer face inwards, from the inner one outwards;
/// at a crease by as much along each of its normals, as nearly as there is such a place. Normals stay.
/// @param face  normals outward; thickness  mm, of the whole wall
/// Errors: RequirementError: a shell folds, half of the wall being thicker than the face's radius of curvature: names
/// the place. Cost: linear.
MidSurface mid_surface(const ShellMesh& face, WallFace which, double thickness);

/// Between both faces of a wall: every node moves half way to its nearest point of the other face; the length of the
/// way is the thickness there, and the normal is the mean of both faces'.
/// @param other  the wall's other face, normals outward
/// Errors: as above; InputError: the other face lies on the other side of this one.
MidSurface mid_surface_between(const ShellMesh& face, WallFace which, const Target& other);

/// How far the curved surface is from lying half of a wall away from a face, mm: mean over area, and largest.
/// Sampled: a few points per shell. Cost: logarithmic in the face's triangles, per shell.
std::array<double, 2> half_wall_error(const ShellMesh& shell, const Target& face, double thickness);

}  // namespace tunica
