#include "tunica/shell/patch/shape_function.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

TEST(ShapeFunction, ClosedFormIsTheInverseForAnyShapeAndUnitOfLength) {
  for (const double unit : {1e-3, 1.0, 1e3}) {
    for (const PlaneTriangle t : {PlaneTriangle{1, 0.5, 0.9}, {2, -0.7, 0.3}, {0.4, 3, 1.5}, {1, 1, 1}, {1, 0, 1e-2}}) {
      const PlaneTriangle scaled{unit * t.a, unit * t.b, unit * t.h};
      const Matrix9 product = shape_matrix(scaled) * inverse_shape_matrix(scaled);
      // Rows and columns are compared in their own scale: u mixes displacements and slopes.
      for (int i = 0; i < 9; ++i) {
        for (int j = 0; j < 9; ++j) {
          const double scale = (i % 3 == 0 ? unit : 1) / (j % 3 == 0 ? unit : 1);
          EXPECT_NEAR(product(i, j) / scale, i == j ? 1 : 0, 1e-8) << unit << ' ' << i << ' ' << j;
        }
      }
    }
  }
}

TEST(ShapeFunction, DerivativesAgreeWithDifferences) {
  const double x = 0.3, y = -0.7, e = 1e-6;
  EXPECT_TRUE(monomials_dx(x, y).isApprox((monomials(x + e, y) - monomials(x - e, y)) / (2 * e), 1e-8));
  EXPECT_TRUE(monomials_dy(x, y).isApprox((monomials(x, y + e) - monomials(x, y - e)) / (2 * e), 1e-8));
  EXPECT_TRUE(monomials_dxx(x, y).isApprox((monomials_dx(x + e, y) - monomials_dx(x - e, y)) / (2 * e), 1e-8));
  EXPECT_TRUE(monomials_dxy(x, y).isApprox((monomials_dx(x, y + e) - monomials_dx(x, y - e)) / (2 * e), 1e-8));
  EXPECT_TRUE(monomials_dyy(x, y).isApprox((monomials_dy(x, y + e) - monomials_dy(x, y - e)) / (2 * e), 1e-8));
}

}  // namespace
}  // namespace tunica
