#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

/// The middle of a wall, of which one face or both are known.
namespace tunica {

enum class WallFace { outer, inner };

/// "outer" or "inner".
constexpr const char* name_of(WallFace face) { return face == WallFace::outer ? "outer" : "inner"; }
/// The other one.
constexpr WallFace behind(WallFace face) { return face == WallFace::outer ? WallFace::inner : WallFace::outer; }

/// The surface half of a wall away from one of its faces.
struct HalfWaySurface {
  TriangleMesh mesh;              ///< an oriented manifold, normals outward
  double cell = 0;                ///< mm, of the grid that it was found by
  std::size_t left_out = 0;       ///< pieces beside those that the face has
  double left_out_area = 0;       ///< mm^2, of these
  std::size_t crossing = 0;       ///< pairs of triangles that cross and could not be parted
  std::array<double, 2> error{};  ///< mm: mean and largest distance of its triangles' middles from half a wall away
};

/// All points that are half of the thickness away from the face: outside of an inner one, inside of an outer one. Where
/// half of the wall is thicker than the radius of curvature, as in a crotch of two vessels, parts of the face have no
/// such points, and the surface has an edge there instead of a fold.
/// The signed distance is sampled where it is near half the thickness, marching cubes give a surface, and its vertices
/// move along the way to their nearest point of the face until they are half the thickness from it. The grid is as fine
/// as the face's triangles and its body, and finer until the mean error is below 0.01 % of the diagonal, but at least
/// 0.1 % and at most 1 % of the thickness.
/// An open face is first continued beyond its rims. At a rim in a plane the surface ends in that plane; at another one
/// beside the rim. Of its pieces the largest are kept, as many as the face has.
/// @param face  an oriented manifold, normals outward; thickness  mm, of the whole wall
/// Errors: RequirementError: nothing is so far inside; the wall is thinner than a ten-thousandth of the diagonal; or
/// the grid would be too large. Interrupted. Source: distance as Baerentzen, Aanaes 2005; crossings next to samples are
/// moved onto them as in Raman, Wenger 2008. Cost: some 10 us per triangle of the result; 4 bytes per point of the
/// grid, of which there are at most 150 million. Limits: parts thinner than a cell may be lost; a rim that is cut at
/// less than 30 degrees to the wall counts as one that lies in no plane.
HalfWaySurface half_way_surface(const Target& face, WallFace which, double thickness, const Progress& progress = {});

/// A coarse mesh of the face, each vertex moved to the surface half of the wall away. Cost: linear.
TriangleMesh moved_half_way(TriangleMesh coarse, const Target& face, WallFace which, double thickness,
                            const Target& half_way);

struct MidSurface {
  ShellMesh shell;
  std::vector<double> thickness;  ///< mm, per vertex
};

/// Between both faces of a wall: every node moves half way to its nearest point of the other face; the length of the
/// way is the thickness there, and the normal is the mean of both faces'.
/// @param face  normals outward; other  the wall's other face, normals outward
/// Errors: RequirementError: a shell folds, half of the wall being thicker than the face's radius of curvature: names
/// the place; InputError: the other face lies on the other side of this one. Cost: linear.
MidSurface mid_surface_between(const ShellMesh& face, WallFace which, const Target& other);

/// How far the curved surface is from lying half of a wall away from a face, mm: mean over area, and largest.
/// Sampled: a few points per shell. Cost: logarithmic in the face's triangles, per shell.
std::array<double, 2> half_wall_error(const ShellMesh& shell, const Target& face, double thickness);

}  // namespace tunica
