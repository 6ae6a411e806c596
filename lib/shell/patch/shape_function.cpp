#include "tunica/shell/patch/shape_function.hpp"

namespace tunica {

Vector9 monomials(double x, double y) {
  return (Vector9() << 1, x, y, x * x, x * y, y * y, x * x * x, x * y * y, y * y * y).finished();
}

Vector9 monomials_dx(double x, double y) { return (Vector9() << 0, 1, 0, 2 * x, y, 0, 3 * x * x, y * y, 0).finished(); }

Vector9 monomials_dy(double x, double y) {
  return (Vector9() << 0, 0, 1, 0, x, 2 * y, 0, 2 * x * y, 3 * y * y).finished();
}

Vector9 monomials_dxx(double x, double /*y*/) { return (Vector9() << 0, 0, 0, 2, 0, 0, 6 * x, 0, 0).finished(); }

Vector9 monomials_dxy(double /*x*/, double y) { return (Vector9() << 0, 0, 0, 0, 1, 0, 0, 2 * y, 0).finished(); }

Vector9 monomials_dyy(double x, double y) { return (Vector9() << 0, 0, 0, 0, 0, 2, 0, 2 * x, 6 * y).finished(); }

Matrix9 shape_matrix(const PlaneTriangle& triangle) {
  const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(triangle.a, 0), Vec2(triangle.b, triangle.h)};
  Matrix9 c;
  for (int k = 0; k < 3; ++k) {
    const Vec2& p = corners[k];
    c.row(3 * k) = monomials(p.x(), p.y()).transpose();
    c.row(3 * k + 1) = monomials_dy(p.x(), p.y()).transpose();
    c.row(3 * k + 2) = -monomials_dx(p.x(), p.y()).transpose();
  }
  return c;
}

Vector9 shape_coefficients(const PlaneTriangle& triangle, const Vector9& u) {
  const auto [a, b, h] = triangle;
  const double w1 = u[0], wy1 = u[1], wx1 = -u[2];
  const double w2 = u[3], wy2 = u[4], wx2 = -u[5];
  const double w3 = u[6], wy3 = u[7], wx3 = -u[8];
  Vector9 c;
  // Edge 1-2: w is the cubic Hermite interpolant there, dw/dy is linear because x^2 y is missing from eq. (1).
  const double chord = (w2 - w1) / a;
  c[0] = w1;
  c[1] = wx1;
  c[2] = wy1;
  c[3] = (3 * chord - 2 * wx1 - wx2) / a;
  c[4] = (wy2 - wy1) / a;
  c[6] = (wx1 + wx2 - 2 * chord) / (a * a);
  // Corner 3: the three values left over for y^2, xy^2, y^3.
  const double w_left = w3 - (c[0] + b * (c[1] + b * (c[3] + b * c[6])) + h * (c[2] + b * c[4]));
  const double wx_left = wx3 - (c[1] + b * (2 * c[3] + 3 * b * c[6]) + h * c[4]);
  const double wy_left = wy3 - (c[2] + b * c[4]);
  c[7] = wx_left / (h * h);
  const double value = w_left - b * wx_left;
  const double slope = h * wy_left - 2 * b * wx_left;
  c[5] = (3 * value - slope) / (h * h);
  c[8] = (slope - 2 * value) / (h * h * h);
  return c;
}

Matrix9 inverse_shape_matrix(const PlaneTriangle& triangle) {
  Matrix9 inverse;
  for (int k = 0; k < 9; ++k) {
    inverse.col(k) = shape_coefficients(triangle, Vector9::Unit(k));
  }
  return inverse;
}

double centre_ordinate(double foot, double b300, double b210, double b120, double b030, double b201, double b021) {
  // d^3 w / dx^2 dy = 0, with x the direction (-1, 1, 0) and y the direction (foot - 1, -foot, 1), both up to a factor.
  return 0.5 * (b201 + b021 - (1 - foot) * (b300 - 2 * b210 + b120) - foot * (b210 - 2 * b120 + b030));
}

}  // namespace tunica
