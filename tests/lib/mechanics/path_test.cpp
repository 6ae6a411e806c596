// Paths by arc length, through limit points.

#include "benchmarks.hpp"
#include "tunica/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

/// A quarter of the hinged roof of Sze, Liu, Lo 2004 under a force at its centre; the probe is there.
Model hinged_roof(std::size_t n, double thickness) {
  const Grid grid = make_grid(
      n, n, [](double u, double v) { return Vec3(254 * u, 2540 * std::sin(0.1 * v), 2540 * std::cos(0.1 * v)); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 3102.75, 0.3, thickness));
  hold(
      model, [](const Vec3& p) { return std::abs(p.y() - 2540 * std::sin(0.1)) < 1e-6; }, "xyz", "yz");
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-6; }, "x", "yz");
  hold(
      model, [](const Vec3& p) { return std::abs(p.y()) < 1e-6; }, "y", "xz");
  model.probes.push_back({"centre", 0, grid.node(0, 0)});
  return model;
}

void press(Model& roof) { roof.loads.push_back({0, ForceLoad{{roof.probes[0].node}, Vec3(0, 0, -750)}, {}}); }

struct Path {
  std::vector<double> deflection, factor;
  Summary summary;
};

Path follow(const Model& model, const ArcLengthRun& run, int axis = 2, double sign = -1) {
  RunSettings settings;
  settings.kind = run;
  Path path;
  path.summary = solve(model, settings, [&](const State& state) {
    path.deflection.push_back(sign * state.displacement[model.probes[0].node][axis]);
    path.factor.push_back(state.load_factor);
    EXPECT_TRUE(state.converged);
    EXPECT_EQ(state.time, static_cast<double>(path.factor.size() - 1));
  });
  return path;
}

/// Strips and membranes that stiffen at a ten-thousandth of the first step: a plane ahead meets states of the strip
/// pressed together, too, which no path leads to.
TEST(ArcLength, GoesTowardsTheLoadHoweverSoftTheShellBegins) {
  const auto on = [](double at, double length) {
    return [at, length](const Vec3& p) { return std::abs(p.x() - at * length) < eps; };
  };
  for (const double thickness : {0.05, 0.1, 0.5}) {
    for (const std::size_t steps : {3, 10, 100}) {
      const Grid grid = make_grid(20, 4, [](double u, double v) { return Vec3(50 * u, 10 * v, 0); });
      Model model;
      model.shells.push_back(flat_body(grid.mesh, 1, 0, thickness));
      hold(model, on(0, 50), "xyz", "xyz");
      hold(model, on(1, 50), "xyz", "xyz");
      model.fixes.back().displacement = Vec3(1, 0, 0);
      model.loads.push_back({0, AreaLoad{Vec3(0, 0, 1e-7)}, {}});
      model.probes.push_back({"middle", 0, grid.node(10, 2)});
      const Path path = follow(model, {200, 1 / static_cast<double>(steps), 1, {}}, 2, 1);
      EXPECT_GT(*std::min_element(path.factor.begin() + 1, path.factor.end()), 0);
      EXPECT_NEAR(path.factor.back(), 1, 1e-9);
      const double at_once = last_state(model, nonlinear_run({1})).displacement[grid.node(10, 2)].z();
      EXPECT_NEAR(path.deflection.back(), at_once, 1e-3 * at_once) << thickness << ' ' << steps;
      EXPECT_FALSE(path.summary.short_of_factor);
    }
  }
}

TEST(ArcLength, SaysWhereItsStepsRanOut) {
  Model roof = hinged_roof(4, 12.7);
  press(roof);
  const Path path = follow(roof, {2, 0.01, 1, {}});
  ASSERT_TRUE(path.summary.short_of_factor);
  EXPECT_EQ(*path.summary.short_of_factor, path.factor.back());
  EXPECT_LT(path.factor.back(), 0.5);
}

/// The load factor at a deflection, by straight lines between the states; of the first pass.
double factor_at(const Path& path, double deflection) {
  for (std::size_t i = 1; i < path.factor.size(); ++i) {
    if (path.deflection[i] >= deflection) {
      const double part = (deflection - path.deflection[i - 1]) / (path.deflection[i] - path.deflection[i - 1]);
      return path.factor[i - 1] + part * (path.factor[i] - path.factor[i - 1]);
    }
  }
  return std::numeric_limits<double>::quiet_NaN();
}

TEST(ArcLength, HingedRoofThroughBothLimitPoints) {
  Model model = hinged_roof(8, 12.7);
  press(model);
  ArcLengthRun run;
  run.until = {0, 2, -30};
  const Path path = follow(model, run);
  const std::map<double, double> reference{{1.638, .1980},  {4.477, .4686},  {7.057, .6381},  {9.339, .7246},
                                           {11.293, .7421}, {14.728, .5643}, {17.657, .2272}, {19.852, .1729},
                                           {24.049, .3871}, {29.374, 1.0835}};
  for (const auto& [w, factor] : reference) {
    EXPECT_NEAR(factor_at(path, w), factor, 0.03) << w;
  }
  ASSERT_EQ(path.summary.limit_factors.size(), 2U);
  EXPECT_NEAR(path.summary.limit_factors[0], 0.7421, 0.005);
  EXPECT_NEAR(path.summary.limit_factors[1], 0.1729, 0.005);
  EXPECT_TRUE(path.summary.branch_factors.empty());
  EXPECT_NEAR(path.deflection.back(), 30, 1e-6);
  EXPECT_LT(path.summary.steps, 60U);
}

TEST(ArcLength, ThinRoofSnapsBack) {
  Model model = hinged_roof(8, 6.35);
  press(model);
  ArcLengthRun run;
  run.until = {0, 2, -30};
  const Path path = follow(model, run);
  ASSERT_EQ(path.summary.limit_factors.size(), 2U);
  EXPECT_NEAR(path.summary.limit_factors[0], 590.0 / 3000, 0.005);  // as in published curves
  EXPECT_NEAR(path.summary.limit_factors[1], -383.0 / 3000, 0.006);
  // The centre goes back while the path goes on.
  const auto highest = std::adjacent_find(path.deflection.begin(), path.deflection.end(), std::greater<>());
  ASSERT_NE(highest, path.deflection.end());
  EXPECT_NEAR(*highest, 17, 0.5);
  EXPECT_NEAR(*std::min_element(highest, path.deflection.end()), 14.5, 0.5);
}

TEST(ArcLength, AgreesWithDisplacementControl) {
  // The same state by a prescribed displacement, beyond the limit point.
  Model pushed = hinged_roof(8, 12.7);
  pushed.fixes.push_back(
      {0, {pushed.probes[0].node}, {false, false, true}, {false, false, false}, Vec3(0, 0, -16), {}});
  const State by_displacement = last_state(pushed, nonlinear_run({0.25, 0.5, 0.75, 1}));
  Model model = hinged_roof(8, 12.7);
  press(model);
  RunSettings settings;
  settings.kind = ArcLengthRun{100, 0.1, std::nullopt, ArcLengthRun::Until{0, 2, -16}};
  const State by_arc_length = last_state(model, settings);
  EXPECT_LT(by_arc_length.load_factor, 0.5);
  EXPECT_NEAR(by_arc_length.strain_energy, by_displacement.strain_energy, 1e-6 * by_displacement.strain_energy);
  for (std::size_t i = 0; i < by_arc_length.displacement.size(); ++i) {
    EXPECT_LT((by_arc_length.displacement[i] - by_displacement.displacement[i]).norm(), 1e-5);
  }
}

TEST(ArcLength, PrescribedDisplacementsFollowTheFactor) {
  Model pushed = hinged_roof(4, 6.35);
  pushed.fixes.push_back(
      {0, {pushed.probes[0].node}, {false, false, true}, {false, false, false}, Vec3(0, 0, -10), {}});
  RunSettings settings;
  settings.kind = ArcLengthRun{100, 0.1, 1, std::nullopt};
  const State state = last_state(pushed, settings);
  EXPECT_NEAR(state.load_factor, 1, 1e-9);
  EXPECT_NEAR(state.displacement[pushed.probes[0].node].z(), -10, 1e-8);
  const State steps = last_state(pushed, nonlinear_run({0.5, 1}));
  EXPECT_NEAR(state.strain_energy, steps.strain_energy, 1e-6 * steps.strain_energy);
}

TEST(ArcLength, InflatedSphereBeyondItsLimitPoint) {
  // p = 2 E t / ((1 - nu) R) e / (1 + e)^2: a limit point at a quarter of the load, e = 1.
  Model model;
  ShellBody body = flat_body(make_sphere(10, 2), 1000, 0.3, 0.2);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  model.loads.push_back({0, PressureLoad{2 * 1000 * 0.2 / (0.7 * 10), true}, {}});
  model.probes.push_back({"pole", 0, 1});
  const int axis = 1;
  const double radius = model.shells[0].mesh.vertices[1][axis];
  ArcLengthRun run;
  run.until = {0, axis, 2 * radius};
  const Path path = follow(model, run, axis, 1);
  for (std::size_t i = 1; i < path.factor.size(); ++i) {
    const double e = path.deflection[i] / radius;
    EXPECT_NEAR(path.factor[i], e / ((1 + e) * (1 + e)), 0.01 * path.factor[i]) << e;
  }
  ASSERT_EQ(path.summary.limit_factors.size(), 1U);
  EXPECT_NEAR(path.summary.limit_factors[0], 0.25, 0.001);
  EXPECT_FALSE(path.summary.branch_factors.empty());  // a soft sphere may lose its shape before
  EXPECT_NEAR(path.deflection.back(), 2 * radius, 1e-6);
}

TEST(ArcLength, ShallowTrussOfTwoStripsIsExact) {
  // Two strips without bending stiffness to speak of, hinged, that snap through: with rise h over half span b, length
  // l and deflection w, P = 2 E A (l0 - l) / l0 (h - w) / l; here E A per width, nu = 0.
  const double half = 10, rise = 1, t = 1e-3;
  const Grid grid = make_grid(1, 1, [&](double u, double v) { return Vec3(half * u, v, rise * u); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0, t));
  hold(
      model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xz");
  hold(
      model, [&](const Vec3& p) { return p.x() > half - 1e-9; }, "xy", "xz");
  model.probes.push_back({"top", 0, grid.node(1, 0)});
  model.loads.push_back({0, EdgeLoad{{{grid.node(1, 0), grid.node(1, 1)}}, Vec3(0, 0, -1e-3)}, {}});
  ArcLengthRun run;
  run.until = {0, 2, -2.2};
  const Path path = follow(model, run);
  const double l0 = std::hypot(half, rise);
  for (std::size_t i = 0; i < path.factor.size(); ++i) {
    const double w = path.deflection[i];
    const double l = std::hypot(half, rise - w);
    const double force = 1000 * t * (l0 - l) / l0 * (rise - w) / l;
    EXPECT_NEAR(1e-3 * path.factor[i], force, 2e-6) << w;
  }
  EXPECT_EQ(path.summary.limit_factors.size(), 2U);
  EXPECT_NEAR(path.summary.limit_factors[0], -path.summary.limit_factors[1], 1e-3);
}

std::string message(const Model& model, const ArcLengthRun& run, Solver solver = Solver::automatic) {
  RunSettings settings;
  settings.kind = run;
  settings.solver = solver;
  return error_of(model, settings);
}

TEST(ArcLength, WhatCannotBeIsRefused) {
  using testing::HasSubstr;
  Model model = hinged_roof(4, 12.7);
  ArcLengthRun run;
  EXPECT_THAT(message(model, run), HasSubstr("input: arc length needs a load"));
  press(model);
  EXPECT_THAT(message(model, run, Solver::cg), HasSubstr("direct solver"));
  run.max_steps = 3;
  EXPECT_EQ(message(model, run), "");
  run.until = {0, 2, -30};
  EXPECT_THAT(message(model, run), HasSubstr("requirement: arc length: the path ended after 3 steps"));
  run.max_steps = 200;
  run.max_factor = 0.5;
  EXPECT_THAT(message(model, run), HasSubstr("by max_factor, before centre reached -30 mm along z"));
  run.until = {1, 2, -30};
  EXPECT_THAT(message(model, run), HasSubstr("input: arc length: until"));
  run.until.reset();
  model.loads[0].ramp.points = {{0, 0}, {1, 1}};
  EXPECT_THAT(message(model, run), HasSubstr("remove the ramps"));
}

}  // namespace
}  // namespace tunica
