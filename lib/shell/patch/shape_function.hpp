#pragma once

#include "tunica/core/types.hpp"

/// The one shape function of tunica (Comas, Duriez, Cotin 2010, eq. 1-2). It describes the curved geometry, gives the
/// bending stiffness, and spreads contact forces to the nodes; this is the only place where it is written.
///
/// Over a triangle with corners 1 = (0, 0), 2 = (a, 0), 3 = (b, h) in its own plane, x along edge 1-2:
///   w(x, y) = c1 + c2 x + c3 y + c4 x^2 + c5 xy + c6 y^2 + c7 x^3 + c8 xy^2 + c9 y^3                             (1)
/// and the nine nodal values u = (w, dw/dy, -dw/dx) at corners 1, 2, 3, so that u = C c                           (2)
namespace tunica {

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

/// The corners of a triangle in its own plane: 1 = (0, 0), 2 = (a, 0), 3 = (b, h).
/// Limits: a > 0 and h > 0; the inverse of C exists for every such triangle (det C = a^5 h^6 up to sign).
struct PlaneTriangle {
  double a = 0;
  double b = 0;
  double h = 0;
};

/// The nine monomials of eq. (1), and their derivatives, at (x, y).
Vector9 monomials(double x, double y);
Vector9 monomials_dx(double x, double y);
Vector9 monomials_dy(double x, double y);
Vector9 monomials_dxx(double x, double y);
Vector9 monomials_dxy(double x, double y);
Vector9 monomials_dyy(double x, double y);

/// C of eq. (2): nodal values u from coefficients c.
Matrix9 shape_matrix(const PlaneTriangle& triangle);

/// The inverse of C in closed form: coefficients c from nodal values u. Unlike a numerical inversion its accuracy
/// does not depend on the unit of length (the condition of C grows like length^-3).
Matrix9 inverse_shape_matrix(const PlaneTriangle& triangle);

/// Coefficients c from nodal values u without forming the matrix. Cost: about 60 flops.
Vector9 shape_coefficients(const PlaneTriangle& triangle, const Vector9& u);

/// The same cubic as a Bezier triangle. Corner and edge ordinates follow from values and slopes at the corners alone;
/// what eq. (1) adds is that x^2 y is missing, and that fixes the centre ordinate.
/// @param foot  where the foot of corner 3 on the line 1-2 lies, as a fraction of the edge (b / a; may leave [0, 1])
/// @param b300, b210, b120, b030  the four ordinates along edge 1-2; b201, b021  the first ones from 1 and 2 towards 3
/// @return b111
double centre_ordinate(double foot, double b300, double b210, double b120, double b030, double b201, double b021);

}  // namespace tunica
