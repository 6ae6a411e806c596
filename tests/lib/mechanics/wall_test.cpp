// What a run says about the wall: largest displacement of the curved surface, stresses and strains at the nodes.

#include "tunica/mechanics/model/wall.hpp"
#include "benchmarks.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

Model square(std::size_t n) {
  Model model;
  model.shells.push_back(
      flat_body(make_grid(n, n, [](double u, double v) { return Vec3(3 * u, 2 * v, 0); }).mesh, 1, 0, 1));
  return model;
}

TEST(Wall, MeanOfALinearFieldIsByArea) {
  const std::vector<Facet> facets{{3, {1, 2, 6}}, {1, {0, 0, 3}}};
  EXPECT_DOUBLE_EQ(area_mean(facets), 2.5);
  EXPECT_EQ(area_mean({}), 0);
}

TEST(Wall, QuantileOfALinearFieldIsExact) {
  for (const std::size_t n : {1, 2, 5}) {
    const Model model = square(n);
    std::vector<double> x;
    std::vector<double> sum;
    for (const Vec3& p : model.shells[0].mesh.vertices) {
      x.push_back(p.x() / 3);
      sum.push_back(p.x() / 3 + p.y() / 2);
    }
    for (const double above : {0.01, 0.3, 0.5}) {
      EXPECT_NEAR(area_quantile(model, x, above), 1 - above, 1e-9);
      EXPECT_NEAR(area_quantile(model, sum, above), 2 - std::sqrt(2 * above), 1e-9);
    }
    EXPECT_NEAR(area_quantile(model, sum, 0.8), std::sqrt(2 * 0.2), 1e-9);
  }
}

/// A strip of one cell between two hinges, bent by equal moments at its ends: w = M L^2 / (8 E I) half way.
TEST(Wall, TheLargestDisplacementMayLieBetweenTheNodes) {
  constexpr double length = 10, thickness = 0.1, young = 1.2e6, moment = 1;
  const Grid grid = make_grid(1, 1, [&](double u, double v) { return Vec3(length * u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, young, 0, thickness));
  hold(
      model, [](const Vec3&) { return true; }, "xyz", "xz");
  model.loads.push_back({0, MomentLoad{{grid.node(0, 0), grid.node(0, 1)}, Vec3(0, -moment, 0)}, {}});
  model.loads.push_back({0, MomentLoad{{grid.node(1, 0), grid.node(1, 1)}, Vec3(0, moment, 0)}, {}});
  const double bending = young * thickness * thickness * thickness / 12;
  for (const RunSettings& settings : {linear_run(), nonlinear_run({1})}) {
    const State state = last_state(model, settings);
    const ElementFields fields = element_fields(model, state);
    for (const Vec3& u : state.displacement) {
      EXPECT_EQ(u.norm(), 0);
    }
    EXPECT_NEAR(fields.largest_displacement, moment * length * length / (8 * bending),
                0.01 * fields.largest_displacement);
  }
}

/// A cantilever under an end moment: s = 6 M / (b t^2) at both faces, e = s / E where it stretches.
TEST(Wall, ConstantStressIsThatOfTheBeam) {
  constexpr double thickness = 0.1, young = 1.2e6, moment = 0.1;
  const Grid grid = make_grid(8, 1, [](double u, double v) { return Vec3(10 * u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, young, 0, thickness));
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, MomentLoad{{grid.node(8, 0), grid.node(8, 1)}, Vec3(0, -moment, 0)}, {}});
  const double stress = 6 * moment / (thickness * thickness);
  const ElementFields fields = element_fields(model, last_state(model, nonlinear_run({1})));
  EXPECT_NEAR(fields.wall.stress_max, stress, 1e-3 * stress);
  EXPECT_NEAR(fields.wall.stress_p99, stress, 1e-3 * stress);
  EXPECT_NEAR(fields.wall.strain_max, stress / young, 1e-3 * stress / young);
  EXPECT_NEAR(fields.wall.strain_p99, stress / young, 1e-3 * stress / young);
  ASSERT_EQ(fields.von_mises.size(), model.node_count());
}

/// The same under an end shear: largest at the clamped end, s = 6 P (L - x) / (b t^2), to the first order in the cells.
TEST(Wall, TheLargestStressIsWhereTheBeamIsClamped) {
  const Grid grid = make_grid(40, 2, [](double u, double v) { return Vec3(10 * u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1.2e6, 0, 0.1));
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
  EdgeLoad edge{{{grid.node(40, 0), grid.node(40, 1)}, {grid.node(40, 1), grid.node(40, 2)}}, Vec3(0, 0, 1e-3)};
  model.loads.push_back({0, edge, {}});
  const Wall wall = element_fields(model, last_state(model, linear_run())).wall;
  const double largest = 6 * 1e-3 * 10 / 0.01;
  EXPECT_NEAR(wall.stress_max, largest, 0.025 * largest);
  EXPECT_NEAR(wall.stress_p99, 0.99 * largest, 0.025 * largest);
  EXPECT_LT(wall.stress_p99, wall.stress_max);
  EXPECT_EQ(wall.stress_max_at.x(), 0);
}

/// A tube under pressure on a belt, whole and by its half.
TEST(Wall, APlaneOfSymmetryIsNoSupport) {
  const auto wall_of = [](bool half, const char* rotations) {
    Model model;
    ShellMesh mesh = tube_mesh(10, 10, half ? 40 : 80, 48, half ? 32 : 64);
    for (Vec3& x : mesh.vertices) {
      x.z() -= half ? 0 : 40;
    }
    model.shells.push_back(flat_body(mesh, 1, 0.3, 0.5));
    model.shells[0].curved = true;
    model.shells[0].rest = Rest::curved;
    hold(
        model, [](const Vec3& p) { return std::abs(p.z()) > 40 - eps; }, "xyz", "xyz");
    if (half) {
      hold(
          model, [](const Vec3& p) { return std::abs(p.z()) < eps; }, "z", rotations);
    }
    PressureLoad belt{1e-3, true};
    for (const auto& t : mesh.triangles) {
      const Vec3 centre = (mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]) / 3;
      belt.shares.push_back(std::abs(centre.z()) < 3.75 ? 1 : 0);
    }
    model.loads.push_back({0, belt, {}});
    return element_fields(model, last_state(model, linear_run())).wall;
  };
  const Wall whole = wall_of(false, ""), half = wall_of(true, "xy"), supported = wall_of(true, "xyz");
  EXPECT_NEAR(half.membrane_p99, whole.membrane_p99, 0.01 * whole.membrane_p99);
  EXPECT_NEAR(half.stress_p99, whole.stress_p99, 0.01 * whole.stress_p99);
  EXPECT_NEAR(half.left_out, whole.left_out, 0.01);
  EXPECT_FALSE(half.is_max_on_held);
  EXPECT_GT(supported.left_out, whole.left_out + 0.05);
  Fix plane;
  plane.translation = {false, false, true};
  plane.rotation = {true, true, false};
  EXPECT_EQ(plane_of_symmetry(plane), Vec3(0, 0, 1));
  plane.displacement.z() = 1;
  EXPECT_FALSE(plane_of_symmetry(plane));
}

}  // namespace
}  // namespace tunica
