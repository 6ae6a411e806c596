// The plane elements: patch tests, invariance, units.

#include "tunica/mechanics/elements/element_stiffness.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <functional>

namespace tunica {
namespace {

using Element = std::function<PlaneStiffness(const PlaneTriangle&)>;

const Mat3 elasticity = plane_stress({1000, 0.3, {}});
constexpr double thickness = 0.1;

/// With the plane's freedoms (u, v, theta_z) per corner.
PlaneStiffness in_freedoms(const PlaneTriangle& t, const MembraneStiffness& membrane) {
  const auto g = barycentric_gradients(t);
  Matrix39 strain, deviation;
  for (int k = 0; k < 3; ++k) {
    strain.middleCols<3>(3 * k) << g(0, k), 0, 0, 0, g(1, k), 0, g(1, k), g(0, k), 0;
    strain.col(3 * k + 2) = membrane.bow.col((k + 2) % 3) - membrane.bow.col(k);
    for (int r = 0; r < 3; ++r) {
      deviation.block<1, 3>(r, 3 * k) << g(1, k) / 2, -g(0, k) / 2, r == k ? 1 : 0;
    }
  }
  return {strain.transpose() * membrane.basic * strain + deviation.transpose() * membrane.higher_order * deviation,
          strain};
}

PlaneStiffness cst(const PlaneTriangle& t) { return in_freedoms(t, membrane_cst(t, elasticity, thickness)); }
PlaneStiffness opt(const PlaneTriangle& t) { return in_freedoms(t, membrane_opt(t, elasticity, thickness)); }
PlaneStiffness adapt(const PlaneTriangle& t) { return in_freedoms(t, membrane_opt(t, elasticity, thickness, 1e-4)); }
PlaneStiffness comas(const PlaneTriangle& t) { return bending_comas(t, elasticity, thickness); }
PlaneStiffness consistent(const PlaneTriangle& t) { return bending_comas_consistent(t, elasticity, thickness); }
PlaneStiffness dkt(const PlaneTriangle& t) { return bending_dkt(t, elasticity, thickness); }
PlaneStiffness dkt_comas(const PlaneTriangle& t) { return bending_dkt_comas(t, elasticity, thickness); }

/// Stiffness of a triangle anywhere in the plane, in the axes of that plane. A membrane corner is (vector, scalar), a
/// bending corner (scalar, vector).
Matrix9 in_plane(const Element& element, const std::array<Vec2, 3>& corners, bool membrane) {
  const Vec2 edge = corners[1] - corners[0];
  const Vec2 third = corners[2] - corners[0];
  const Vec2 e1 = edge.normalized();
  const Vec2 e2(-e1.y(), e1.x());
  Matrix9 turn = Matrix9::Zero();
  for (int k = 0; k < 3; ++k) {
    const int vector = membrane ? 3 * k : 3 * k + 1;
    turn.block<1, 2>(vector, vector) = e1.transpose();
    turn.block<1, 2>(vector + 1, vector) = e2.transpose();
    const int scalar = membrane ? 3 * k + 2 : 3 * k;
    turn(scalar, scalar) = 1;
  }
  return turn.transpose() * element({edge.norm(), e1.dot(third), e2.dot(third)}).stiffness * turn;
}

/// Freedoms of the exact solution with constant strain or curvature.
Eigen::Vector3d exact(const Vec2& p, bool membrane) {
  const double x = p.x(), y = p.y();
  if (membrane) {
    // u = .1 + .2 x + .3 y, v = -.2 + .1 x - .4 y, theta = (v_x - u_y) / 2
    return {0.1 + 0.2 * x + 0.3 * y, -0.2 + 0.1 * x - 0.4 * y, -0.1};
  }
  // w = .3 + .1 x - .2 y + .5 x^2 - .3 xy + .7 y^2
  return {0.3 + 0.1 * x - 0.2 * y + 0.5 * x * x - 0.3 * x * y + 0.7 * y * y, -0.2 - 0.3 * x + 1.4 * y,
          -(0.1 + x - 0.3 * y)};
}

/// Forces that are left at the inner node of an irregular patch in the exact state, relative to the elements' forces.
double patch_test(const Element& element, bool membrane) {
  const std::array<Vec2, 6> nodes{Vec2(0, 0),     Vec2(2, 0.1),    Vec2(2.3, 1.4),
                                  Vec2(1.1, 2.2), Vec2(-0.3, 1.5), Vec2(0.9, 0.8)};
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double magnitude = 0;
  for (std::size_t k = 0; k < 5; ++k) {
    const std::array<Vec2, 3> corners{nodes[5], nodes[k], nodes[(k + 1) % 5]};
    Vector9 freedoms;
    for (int c = 0; c < 3; ++c) {
      freedoms.segment<3>(3 * c) = exact(corners[static_cast<std::size_t>(c)], membrane);
    }
    const Vector9 force = in_plane(element, corners, membrane) * freedoms;
    sum += force.head<3>();
    magnitude += force.head<3>().norm();
  }
  return sum.norm() / magnitude;
}

TEST(Elements, PassThePatchTest) {
  EXPECT_LT(patch_test(cst, true), 1e-12);
  EXPECT_LT(patch_test(opt, true), 1e-12);
  EXPECT_LT(patch_test(adapt, true), 1e-12);
  EXPECT_LT(patch_test(consistent, false), 1e-12);
  EXPECT_LT(patch_test(dkt, false), 1e-12);
  EXPECT_LT(patch_test(dkt_comas, false), 1e-12);
}

TEST(Elements, ThePapersBendingElementFailsThePatchTest) {
  EXPECT_GT(patch_test(comas, false), 0.01);
  EXPECT_LT(patch_test(comas, false), 1);
}

/// Change of the stiffness when another corner comes first.
double order_dependence(const Element& element, bool membrane) {
  const std::array<Vec2, 3> corners{Vec2(0.1, 0.2), Vec2(1.3, 0.1), Vec2(0.4, 1.1)};
  const Matrix9 first = in_plane(element, corners, membrane);
  const Matrix9 second = in_plane(element, {corners[1], corners[2], corners[0]}, membrane);
  Matrix9 renamed;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      renamed.block<3, 3>(3 * ((i + 1) % 3), 3 * ((j + 1) % 3)) = second.block<3, 3>(3 * i, 3 * j);
    }
  }
  return (first - renamed).norm() / first.norm();
}

TEST(Elements, DoNotDependOnWhichCornerComesFirst) {
  EXPECT_LT(order_dependence(cst, true), 1e-13);
  EXPECT_LT(order_dependence(opt, true), 1e-13);
  EXPECT_LT(order_dependence(consistent, false), 1e-13);
  EXPECT_LT(order_dependence(dkt, false), 1e-13);
  EXPECT_LT(order_dependence(dkt_comas, false), 1e-13);
  EXPECT_GT(order_dependence(comas, false), 0.01);
}

TEST(Elements, DoNotDependOnTheUnitOfLength) {
  // Energy scales like E length^3 when every length, the thickness included, is in another unit.
  const PlaneTriangle triangle{1.2, 0.3, 0.9};
  for (const double unit : {1e-3, 1e3}) {
    const PlaneTriangle scaled{triangle.a * unit, triangle.b * unit, triangle.h * unit};
    const auto check = [&](const PlaneStiffness& one, const PlaneStiffness& other, bool membrane) {
      Vector9 lengths;
      for (int k = 0; k < 3; ++k) {
        lengths.segment<3>(3 * k) = membrane ? Vec3(unit, unit, 1) : Vec3(unit, 1, 1);
      }
      const Matrix9 back = lengths.asDiagonal() * other.stiffness * lengths.asDiagonal() / (unit * unit * unit);
      EXPECT_LT((back - one.stiffness).norm(), 1e-12 * one.stiffness.norm());
    };
    check(cst(triangle), in_freedoms(scaled, membrane_cst(scaled, elasticity, thickness * unit)), true);
    check(opt(triangle), in_freedoms(scaled, membrane_opt(scaled, elasticity, thickness * unit)), true);
    check(comas(triangle), bending_comas(scaled, elasticity, thickness * unit), false);
    check(consistent(triangle), bending_comas_consistent(scaled, elasticity, thickness * unit), false);
    check(dkt(triangle), bending_dkt(scaled, elasticity, thickness * unit), false);
  }
}

TEST(Elements, AdaptedScaleIsOneOnAPlateAndFallsOffWhereTheShellCurves) {
  const std::array<Vec3, 3> corners{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)};
  EXPECT_EQ(adapted_scale(corners, {Vec3::UnitZ(), Vec3::UnitZ(), Vec3::UnitZ()}, 0.1), 1);
  const std::array<Vec3, 3> tilted{Vec3(-0.1, 0, 1), Vec3(0.1, 0, 1), Vec3(0, 0, 1)};
  EXPECT_NEAR(adapted_scale(corners, tilted, 0.1), 1 / (1 + 36.0), 1e-12);
  EXPECT_EQ(adapted_scale(corners, tilted, 1e-6), 1e-4);
}

}  // namespace
}  // namespace tunica
