// shell/patch: THE shape function and the curved surface that positions and normals make.
#pragma once

#include "tunica/shell/patch/shell_mesh.hpp"

#include <array>
#include <string>

/// The curved surface that positions and normals stand for, patch by patch. Parameters of a patch are barycentric:
/// (b2, b3), the weights of corners 2 and 3; corner 1 has 1 - b2 - b3.
namespace tunica {

/// A corner whose normal N meets the facet's normal n at N·n below this makes a shell mesh unfit: the slope of the
/// patch there, tan of the angle between them, would pass 4.9, and the patch leave its facet like a spike.
inline constexpr double least_normal_agreement = 0.2;

/// Squared distance of the unit normals of two triangles at an edge from which on it is a crease, (2 sin 10 degrees)^2:
/// normals 20 degrees apart.
inline constexpr double crease_squared = 0.12061475842818326;

/// A cubic Bezier triangle. Control points in the order 300, 030, 003 (corners), 210, 120 (edge 1-2), 021, 012 (edge
/// 2-3), 102, 201 (edge 3-1), 111 (centre); the digits count the weights of corners 1, 2, 3.
struct CubicPatch {
  std::array<Vec3, 10> control;

  [[nodiscard]] Vec3 point(const Vec2& b) const;
  /// Derivatives of the point by b2 and by b3.
  [[nodiscard]] std::array<Vec3, 2> tangents(const Vec2& b) const;
  /// Second derivatives: b2 b2, b2 b3, b3 b3.
  [[nodiscard]] std::array<Vec3, 3> second_derivatives(const Vec2& b) const;
  /// Unit normal, on the side from which the corners are counter-clockwise. Limits: zero where the patch is singular.
  [[nodiscard]] Vec3 normal(const Vec2& b) const;
};

/// The ten cubic Bernstein polynomials in the order of CubicPatch::control.
std::array<double, 10> bernstein(const Vec2& b);

/// The patch of the paper's shape function over a facet: flat point + w n, w(corners) = 0, gradient of w at a corner
/// -(N·e)/(N·n) for in-plane axes e, averaged over the three choices of the first vertex.
/// @param corners  positions, counter-clockwise; normals  unit normals N at them
/// Source: Comas, Duriez, Cotin 2010, eq. 1-2 and section 3; the averaging makes it independent of the vertices' order.
/// Limits: a facet without area or N·n <= 0 gives no finite patch; require_fit() keeps both out.
CubicPatch comas_patch(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals);

/// The ten ordinates of w in units of length, in the order of CubicPatch::control; the facet's unit normal.
struct Deflection {
  std::array<double, 10> ordinates;
  Vec3 normal;
};
/// The centre ordinate that the nine terms of eq. (1) give to a facet's edge ordinates, averaged over the three choices
/// of the first vertex. Linear in the ordinates.
/// @param edges  1-2, 2-3, 3-1; ordinates  as in Deflection, corners and edges
double averaged_centre(const std::array<Vec3, 3>& edges, const std::array<double, 10>& ordinates);
Deflection comas_deflection(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals);

/// The control point next to `here` on the curve of an edge from `here` to `there`: towards t, the direction of the
/// edge without its part along the normal, by 2 |edge| / (3 (1 + cos(t, edge))), which meets circular arcs to the sixth
/// order. It does not depend on the order of the normals, so that both triangles at an edge find the same point.
/// @param normals  unit, at `here`: of the two triangles at the edge. Where they agree that is the normal; where they
/// differ by 20 degrees or more, a crease, t lies in both tangent planes; in between, it moves from the plane of their
/// mean towards that. Where a crease ends across the edge (t nearly at right angles to it) the mean alone counts.
/// Limits: the normals are not opposite, and neither is along the edge.
Vec3 watertight_edge_point(const Vec3& here, const Vec3& there, const std::array<Vec3, 2>& normals);

/// For each edge of a triangle, from corner k to k + 1, the unit normals at its two ends that lie across it.
using NormalsAcross = std::array<std::array<Vec3, 2>, 3>;

/// The watertight patch over a facet: edge curves by watertight_edge_point(), so that neighbours meet exactly; the
/// centre follows the edges as in the comas patch, coordinate by coordinate (a plane is kept, what is quadratic over
/// the facet met to the fourth order).
/// @param corners, normals  as for comas_patch()
/// @param across  for the edges 1-2, 2-3, 3-1: the normals that the triangle across has at the start and the end of
/// the edge; where they are this triangle's own, or there is none, the edge is smooth
/// Source: the layout of Vlachos et al., Curved PN triangles, I3D 2001, with lengths of the tangents for arcs (theirs
/// err 2 to 6 times as much) and the centre of Comas, Duriez, Cotin 2010, eq. 1.
CubicPatch watertight_patch(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals,
                            const NormalsAcross& across);

/// A triangle's own normals in their place, as if all its edges were smooth.
NormalsAcross own_normals_across(const std::array<Vec3, 3>& normals);

/// The patch over a facet all of whose edges are smooth.
CubicPatch smooth_patch(Patch kind, const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals);

/// The curved patches of all triangles, as shell.patch says. Watertight patches meet exactly along every edge of two
/// triangles that face the same way. Parallel.
std::vector<CubicPatch> curved_patches(const ShellMesh& shell);

/// The smallest N·n over the three corners of a triangle, n the facet's normal; -1 when the facet has no area.
double normal_agreement(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals);
double normal_agreement(const ShellMesh& shell, std::size_t triangle);

/// What every function of a shell mesh relies on: require_valid() of its facets, and a normal of finite length at each
/// corner, as `corner_normals` or `normals` have it. The public functions of this room ask it of the shell meshes that
/// they are given. Errors: InputError that names the first triangle at fault. Cost: linear, some nanoseconds per
/// triangle.
void require_valid(const ShellMesh& shell);

/// require_valid() of a shell mesh that has a triangle. Errors: InputError.
void require_shells(const ShellMesh& shell);

/// Everything a curved surface needs: finite positions, unit normals, indices in range, facets with area, and
/// N·n >= least_normal_agreement at every corner.
/// @param name  what the message starts with: the file
/// Errors: InputError that names the first triangle at fault and where it is.
void require_fit(const ShellMesh& shell, const std::string& name);

/// Whether a facet is more than a line: its height over the longest edge is above 1e-6 of that edge. Less makes no
/// element.
bool has_area(const std::array<Vec3, 3>& corners);

/// How many facets have none.
std::size_t count_without_area(const ShellMesh& shell);

/// A fine triangle mesh of the curved surface. Patches share no vertices: comas patches of adjacent triangles do not
/// meet exactly (gap O(h^3)), watertight ones do where their numbers of pieces agree. Fine triangles and vertices of
/// one patch are consecutive.
struct Tessellation {
  TriangleMesh mesh;
  std::vector<Index> shell;         ///< #F: patch of each fine triangle
  std::vector<Index> vertex_shell;  ///< #V: patch of each vertex
  std::vector<Vec2> barycentric;    ///< #V: (b2, b3) of each vertex in its patch
  double deviation = 0;             ///< mm: a fine triangle and its part of the patch are at most this far apart
};

/// As fine as needed, patch by patch, that `deviation` (mm, > 0) certainly holds both ways: every point of the curved
/// surface has a point of the mesh within it, and the reverse, at the same parameters.
/// Errors: RequirementError when this would take more than `most_triangles`; InputError where the deviation is not
/// finite or not above zero.
/// Source: linear interpolation of a cubic Bezier triangle, bounded by second differences of its control points.
/// Cost: O(#F), about (3/4 second difference / deviation) triangles per patch.
Tessellation tessellate(const ShellMesh& shell, double deviation, std::size_t most_triangles = 100'000'000);

/// How many triangles tessellate() would make.
double tessellation_size(const ShellMesh& shell, double deviation);

/// level pieces per edge, 1 to 10,000 (else InputError): level^2 triangles per patch. Its `deviation` is certified too.
Tessellation tessellate_uniformly(const ShellMesh& shell, int level);

/// Upper bound, mm, of the distance at equal parameters between a patch and its level^2 flat triangles, and between a
/// piece of it, given by the parameters of its corners, and one flat triangle.
double flatness(const CubicPatch& patch, int level);
double flatness(const CubicPatch& patch, const std::array<Vec2, 3>& piece);

/// Volume in mm3 enclosed by the curved surface of a closed shell mesh, positive when its triangles face outward:
/// exact integrals over the patches, and over the gaps between adjacent ones, closed by the ruled surfaces between
/// their edge curves. The whole is a closed surface: it does not depend on the origin. Watertight patches leave no
/// gaps. Errors: InputError when an edge does not have exactly two triangles of opposite direction.
double curved_volume(const ShellMesh& shell);

}  // namespace tunica
