// Load control where the path of equilibria breaks off: the next state of rest, whatever the steps. Figures of Sze,
// Liu, Lo 2004, "Popular benchmark problems for geometric nonlinear analysis of shells", tables 5 to 8.

#include "benchmarks.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace tunica {
namespace {

using namespace benchmarks;

std::vector<double> equal_steps(std::size_t count) {
  std::vector<double> factors(count);
  std::iota(factors.begin(), factors.end(), 1);
  for (double& factor : factors) {
    factor /= static_cast<double>(count);
  }
  return factors;
}

/// Part of a cylinder about y, a quarter around from its top (z) to its side (x), `length` along y from 0: nodes by
/// (around, along). The middle plane x = 0 is one of symmetry.
Model quarter_cylinder(std::size_t around, std::size_t along, double radius, double length, double young,
                       double poisson, double thickness, Grid& grid) {
  grid = make_grid(around, along, [&](double u, double v) {
    return Vec3(radius * std::sin(pi / 2 * u), length * v, radius * std::cos(pi / 2 * u));
  });
  Model model;
  ShellBody body = flat_body(grid.mesh, young, poisson, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  for (const Vec3& p : grid.mesh.vertices) {
    body.mesh.normals.push_back(Vec3(p.x(), 0, p.z()).normalized());
  }
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& p) { return std::abs(p.x()) < eps; }, "x", "yz");
  return model;
}

void add_force(Model& model, Index node, double z) { model.loads.push_back({0, ForceLoad{{node}, Vec3(0, 0, z)}, {}}); }

struct Outcome {
  Summary summary;
  State state;
};

Outcome run(const Model& model, const RunSettings& settings) {
  Outcome outcome;
  outcome.summary = solve(model, settings, [&](const State& state) { outcome.state = state; });
  return outcome;
}

class OpenCylinder : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Snap, OpenCylinder, testing::Values(1, 10, 40));

TEST_P(OpenCylinder, IsPulledOutWhateverTheSteps) {
  Grid grid;
  Model model = quarter_cylinder(24, 16, 4.953, 10.35 / 2, 10.5e6, 0.3125, 0.094, grid);
  hold(
      model, [](const Vec3& p) { return std::abs(p.y()) < eps; }, "y", "xz");
  hold(
      model, [](const Vec3& p) { return std::abs(p.z()) < eps; }, "z", "xy");
  add_force(model, grid.node(0, 0), 10000);
  const Outcome outcome = run(model, nonlinear_run(equal_steps(GetParam())));
  EXPECT_TRUE(outcome.summary.converged);
  EXPECT_EQ(outcome.state.load_factor, 1);
  EXPECT_NEAR(outcome.state.displacement[grid.node(0, 0)].z(), 2.768, 0.03 * 2.768);
  EXPECT_NEAR(-outcome.state.displacement[grid.node(24, 0)].x(), 4.551, 0.03 * 4.551);
  EXPECT_NEAR(-outcome.state.displacement[grid.node(24, 16)].x(), 3.269, 0.03 * 3.269);
}

TEST(Snap, PinchedCylinderWithDiaphragmsCarriesTheWholeLoad) {
  constexpr std::size_t n = 16;
  Grid grid;
  Model model = quarter_cylinder(n, n, 100, 100, 30e3, 0.3, 1, grid);
  hold(
      model, [](const Vec3& p) { return std::abs(p.y()) < eps; }, "y", "xz");
  hold(
      model, [](const Vec3& p) { return std::abs(p.z()) < eps; }, "z", "xy");
  hold(
      model, [](const Vec3& p) { return std::abs(p.y() - 100) < eps; }, "xz", "");
  add_force(model, grid.node(0, 0), -3000);
  const Outcome outcome = run(model, nonlinear_run(equal_steps(10)));
  EXPECT_EQ(outcome.state.load_factor, 1);
  EXPECT_NEAR(-outcome.state.displacement[grid.node(0, 0)].z(), 83.102, 0.03 * 83.102);
}

TEST(SemiCylinder, UnderAnEndForceCarriesTheWholeLoad) {
  Grid grid;
  Model model = quarter_cylinder(12, 12, 101.6, 304.8, 2068.5, 0.3, 3, grid);
  hold(
      model, [](const Vec3& p) { return std::abs(p.z()) < eps; }, "z", "y");
  hold(
      model, [](const Vec3& p) { return std::abs(p.y() - 304.8) < eps; }, "xyz", "xyz");
  add_force(model, grid.node(0, 0), -1000);
  const Outcome outcome = run(model, nonlinear_run(equal_steps(10)));
  EXPECT_EQ(outcome.state.load_factor, 1);
  EXPECT_NEAR(-outcome.state.displacement[grid.node(0, 0)].z(), 171.505, 0.03 * 171.505);
}

class HingedRoof : public testing::TestWithParam<std::size_t> {};
INSTANTIATE_TEST_SUITE_P(Snap, HingedRoof, testing::Values(1, 10, 40));

TEST_P(HingedRoof, SnapsFromItsLimitLoadToItsOtherBranch) {
  constexpr std::size_t n = 8;
  constexpr double last = 1.0835;  // the last factor of the published path
  const Grid grid = make_grid(
      n, n, [](double u, double v) { return Vec3(254 * u, 2540 * std::sin(0.1 * v), 2540 * std::cos(0.1 * v)); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 3102.75, 0.3, 12.7));
  hold(
      model, [](const Vec3& p) { return std::abs(p.y() - 2540 * std::sin(0.1)) < eps; }, "xyz", "yz");
  hold(
      model, [](const Vec3& p) { return p.x() < eps; }, "x", "yz");
  hold(
      model, [](const Vec3& p) { return std::abs(p.y()) < eps; }, "y", "xz");
  add_force(model, grid.node(0, 0), -750 * last);
  const Outcome outcome = run(model, nonlinear_run(equal_steps(GetParam())));
  ASSERT_EQ(outcome.summary.snaps.size(), 1U);
  EXPECT_NEAR(outcome.summary.snaps[0].load_factor * last, 0.7421, 0.005);
  EXPECT_GT(outcome.summary.snaps[0].distance, 26.8 - 11.293);  // the centre's, along a chord of the published path
  EXPECT_NEAR(-outcome.state.displacement[grid.node(0, 0)].z(), 29.374, 0.02 * 29.374);
}

TEST(Snap, WhereNoStateOfRestIsLeftTheLimitLoadIsNamed) {
  // A balloon of linear co-rotational material: p = 2 E t / ((1 - nu) R) e / (1 + e)^2, at most where e = 1.
  const double most = 2 * 1000 * 0.1 / (0.7 * 10) / 4;
  const Model model = pressurised_sphere(2, 0.1, 1.25 * most);
  for (const std::size_t steps : {1, 10}) {
    const std::string message = error_of(model, nonlinear_run(equal_steps(steps)));
    EXPECT_NE(message.find("limit load"), std::string::npos) << message;
    const std::size_t place = message.find("beyond load factor ");
    ASSERT_NE(place, std::string::npos) << message;
    EXPECT_NEAR(std::stod(message.substr(place + 19)), 0.8, 0.03);  // a coarse ball loses its shape a little before
  }
}

}  // namespace
}  // namespace tunica
