#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/shell/patch/shape_function.hpp"

/// Linear stiffness of a flat triangle in its own plane: x along edge 1-2, z along the facet's normal. Plain functions
/// of the triangle, the elasticity and the thickness; each element has a file of its own.
///
/// Membrane freedoms per corner: (u, v, theta_z). Bending freedoms per corner: (w, theta_x, theta_y) with
/// theta_x = dw/dy and theta_y = -dw/dx, as eq. (2) of the paper orders them.
namespace tunica {

using Matrix39 = Eigen::Matrix<double, 3, 9>;

/// Plane-stress elasticity (MPa) for strains (xx, yy, 2 xy).
Mat3 plane_stress(const Material& material);

/// Stiffness (N/mm, N, N mm), and the operator that gives the mean strains (membrane: of the mid-surface; bending: the
/// curvatures -w_xx, -w_yy, -2 w_xy, positive where the face at +z is stretched).
struct PlaneStiffness {
  Matrix9 stiffness;
  Matrix39 mean_strain;
};

/// Membrane part of a triangle. Its mean strain (xx, yy, 2 xy) is that of the chords plus what bows the edges:
///   sum over edges of bow_k (theta_end - theta_start), edge k from corner k to corner k + 1, theta the drilling
///   rotations.
/// The deviations of the drilling rotations from the rotation of the triangle have a stiffness of their own.
struct MembraneStiffness {
  Mat3 basic;         ///< to the mean strain (N mm)
  Mat3 bow;           ///< columns: of the edges
  Mat3 higher_order;  ///< to the deviations at the corners (N mm)
};

/// Constant-strain triangle: edges stay straight. The drilling rotations are tied to the rotation of the triangle by a
/// stiffness that is `drilling` x E t A: it changes no state of constant strain and stays below what stiffens a curved
/// shell.
MembraneStiffness membrane_cst(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness);

/// Felippa's optimal triangle of the ANDES template. `higher_order_scale` multiplies the higher-order part: 1 is OPT;
/// less keeps the patch test and the rank, and softens in-plane bending.
/// Source: Felippa 2003, "A study of optimal membrane triangles with drilling freedoms", eqs. 20-35.
MembraneStiffness membrane_opt(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness,
                               double higher_order_scale = 1);

/// The scale of the higher-order part in `Membrane::adapt`: 1 / (1 + (3 s / t)^2), at least 1e-4, where s is how far
/// the shell bulges over an edge: the largest |(n_j - n_i).(x_j - x_i)|. OPT alone locks where s is not small
/// against the thickness.
double adapted_scale(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& nodal_normals, double thickness);

/// The paper's element: the cubic of lib/shell, corner 1 first. It is not invariant under a renaming of the corners and
/// fails the patch test: the missing x^2 y makes it converge to a wrong limit.
/// Source: Comas, Duriez, Cotin 2010, eq. 1-4.
PlaneStiffness bending_comas(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness);

/// The same cubic with its mean curvature replaced by that of the boundary (cubic w along an edge, linear normal
/// slope), averaged over the three choices of the first corner. Passes the patch test; isotropic.
/// Source: Bergan, Nygard 1984 (free formulation), applied to the paper's polynomial.
PlaneStiffness bending_comas_consistent(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness);

/// Discrete Kirchhoff triangle. Source: Batoz, Bathe, Ho 1980.
PlaneStiffness bending_dkt(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness);

/// Four fifths of bending_dkt() and one fifth of bending_comas_consistent(). Both pass the patch test, and so does any
/// mean of them. DKT alone is too soft where a force acts on a node of few triangles (+ 3 % on the pinched cylinder
/// with 16 x 16 cells), the cubic alone too stiff on coarse curved meshes; this share is below 2.5 % there and better
/// than DKT on plates.
PlaneStiffness bending_dkt_comas(const PlaneTriangle& triangle, const Mat3& elasticity, double thickness);

/// Corners of a triangle as columns; the origin is corner 1.
inline Eigen::Matrix<double, 2, 3> corner_matrix(const PlaneTriangle& triangle) {
  return (Eigen::Matrix<double, 2, 3>() << 0, triangle.a, triangle.b, 0, 0, triangle.h).finished();
}

/// Gradients of the barycentric coordinates as columns.
inline Eigen::Matrix<double, 2, 3> barycentric_gradients(const PlaneTriangle& triangle) {
  const auto [a, b, h] = triangle;
  return (Eigen::Matrix<double, 2, 3>() << -1 / a, 1 / a, 0, (b - a) / (a * h), -b / (a * h), 1 / h).finished();
}

}  // namespace tunica
