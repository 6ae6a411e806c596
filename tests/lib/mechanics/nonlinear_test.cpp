// Large displacements against Sze, Liu, Lo 2004 and exact solutions.

#include "benchmarks.hpp"
#include "tunica/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

std::vector<double> equal_steps(std::size_t count) {
  std::vector<double> factors;
  for (std::size_t i = 1; i <= count; ++i) {
    factors.push_back(static_cast<double>(i) / static_cast<double>(count));
  }
  return factors;
}

Model strip(double length, std::size_t cells, Grid& grid) {
  grid = make_grid(cells, 1, [&](double u, double v) { return Vec3(length * u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1.2e6, 0, 0.1));
  hold(
      model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
  return model;
}

TEST(Nonlinear, CantileverUnderEndShear) {
  Grid grid;
  Model model = strip(10, 16, grid);
  model.loads.push_back({0, EdgeLoad{{{grid.node(16, 0), grid.node(16, 1)}}, Vec3(0, 0, 4)}, {}});
  const std::map<double, std::pair<double, double>> reference{
      {0.2, {0.381, 2.493}}, {0.6, {2.002, 5.444}}, {1.0, {3.286, 6.698}}};
  std::size_t seen = 0;
  solve(model, nonlinear_run({0.2, 0.6, 1.0}), [&](const State& state) {
    const auto place = reference.find(state.time);
    if (place != reference.end()) {
      const Vec3 u = state.displacement[grid.node(16, 0)];
      EXPECT_NEAR(-u.x(), place->second.first, 0.01);
      EXPECT_NEAR(u.z(), place->second.second, 0.015);
      EXPECT_TRUE(state.converged);
      EXPECT_LE(state.residual, 1e-8);
      ++seen;
    }
  });
  EXPECT_EQ(seen, 3U);
}

TEST(Nonlinear, CantileverRollsUpIntoACircle) {
  Grid grid;
  Model model = strip(12, 16, grid);
  model.loads.push_back({0, MomentLoad{{grid.node(16, 0), grid.node(16, 1)}, Vec3(0, -50 * pi / 3, 0)}, {}});
  const State state = last_state(model, nonlinear_run(equal_steps(20)));
  const Vec3 u = state.displacement[grid.node(16, 0)];
  EXPECT_NEAR(u.x(), -12, 0.12);
  EXPECT_NEAR(u.z(), 0, 0.12);
}

// A run that says it has converged has moved what was prescribed to where it was to go, also over places where the path
// loses its stability and the shell is let go.
TEST(Nonlinear, PrescribedDisplacementsAreReachedOrTheRunFails) {
  const Grid grid = make_grid(4, 4, [](double u, double v) { return Vec3(10 * u, 10 * v, 0); });
  const Index centre = grid.node(2, 2);
  std::size_t reached = 0;
  for (const double lift : {3.0, 6.0, 10.0, 20.0}) {
    for (const double pressure : {0.0, 1e-6}) {
      for (const std::size_t steps : {1, 2, 10}) {
        Model model;
        model.shells.push_back(flat_body(grid.mesh, 1, 0.3, 1));
        hold(
            model,
            [](const Vec3& p) {
              return std::min({p.x(), p.y(), 10 - p.x(), 10 - p.y()}) < 1e-9;
            },
            "xyz", "xyz");
        model.fixes.push_back({0, {centre}, {true, true, true}, {false, false, false}, Vec3(0, 0, lift), {}});
        if (pressure > 0) {
          model.loads.push_back({0, PressureLoad{pressure, true}, {}});
        }
        std::vector<double> factors;
        for (std::size_t s = 1; s <= steps; ++s) {
          factors.push_back(static_cast<double>(s) / static_cast<double>(steps));
        }
        try {
          solve(model, nonlinear_run(factors), [&](const State& state) {
            ASSERT_TRUE(state.converged);
            EXPECT_NEAR(state.displacement[centre].z(), state.load_factor * lift, 1e-12 * lift) << lift << ' ' << steps;
          });
          ++reached;
        } catch (const RequirementError& error) {
          EXPECT_THAT(error.what(), testing::HasSubstr("last good state"));
        }
      }
    }
  }
  EXPECT_GE(reached, 6U);
}

// A ramp of any beginning moves to its factor, not by what it changes.
TEST(Nonlinear, PrescribedDisplacementsFollowTheirRampFromItsFirstFactor) {
  const Grid grid = make_grid(2, 4, [](double u, double v) { return Vec3(10 * u, 40 * v, 0); });
  for (const Ramp& ramp : {Ramp{{{0, 1}, {1, 1}}}, Ramp{{{0, 0.5}, {1, 1}}}, Ramp{{{0, 1}, {1, 0.5}}},
                           Ramp{{{0, 1}, {1, 0}}}, Ramp{{{0.5, 0.25}}}}) {
    for (const std::size_t steps : {1, 4}) {
      Model model;
      model.shells.push_back(flat_body(grid.mesh, 1, 0.3, 1));
      hold(
          model, [](const Vec3& p) { return p.y() < 1e-9; }, "xyz", "xyz");
      hold(
          model, [](const Vec3& p) { return p.y() > 40 - 1e-9; }, "xyz", "");
      model.fixes.back().displacement = Vec3(0, 1, 0);
      model.fixes.back().ramp = ramp;
      const Index end = grid.node(0, 4);
      solve(model, nonlinear_run(equal_steps(steps)), [&](const State& state) {
        const double factor = state.load_factor > 0 ? ramp.at(state.load_factor) : 0;
        EXPECT_NEAR(state.displacement[end].y(), factor, 1e-12);
      });
      const double linear = last_state(model, linear_run()).displacement[end].y();
      EXPECT_NEAR(linear, ramp.at(1), 1e-12);
    }
  }
}

TEST(Nonlinear, ClosedSphereUnderPressureIsInBalance) {
  // The supports of a body held by its rigid motions carry nothing, and the shell does not move as a whole.
  const Model model = pressurised_sphere(1, 1, 0.5);
  const State state = last_state(model, nonlinear_run({1}));
  Vec3 mean = Vec3::Zero();
  for (const Vec3& u : state.displacement) {
    mean += u;
  }
  EXPECT_LT(mean.norm(), 1e-9);
  EXPECT_LE(state.residual, 1e-8);
}

/// A sphere of R/t = 250 with 1,280 elements of h^2 = 6 R t, under a part of its classical buckling pressure.
Model compressed_sphere(double part) {
  constexpr double young = 1, thickness = 0.04, radius = 10;
  Model model;
  ShellBody body = flat_body(make_geodesic(radius, 8), young, 0.3, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  body.material.density = 1e-9;
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  const double critical = 2 * young / std::sqrt(3 * 0.91) * thickness * thickness / (radius * radius);
  model.loads.push_back({0, PressureLoad{-part * critical, true}, {}});
  return model;
}

TEST(Nonlinear, VeryThinSphereDoesNotBuckleInWavesOfItsMesh) {
  // Mean strains alone would make it buckle at half of the load that it carries.
  constexpr double part = 0.9;
  const double inward = part * 0.04 * 0.7 / std::sqrt(3 * 0.91);  // linear membrane theory
  RunSettings dynamic;
  dynamic.kind = DynamicRun{0.2, 0.04, {}, Integrator::backward_euler};
  for (const RunSettings& settings : {nonlinear_run({0.5, 1}), dynamic}) {
    const Model model = compressed_sphere(part);
    State state;
    const Summary summary = solve(model, settings, [&](const State& s) { state = s; });
    EXPECT_TRUE(summary.converged);
    ASSERT_TRUE(summary.stiffened_from.has_value());
    EXPECT_LT(*summary.stiffened_from, 0.8);
    double mean = 0;
    for (const Vec3& u : state.displacement) {
      mean += u.norm() / static_cast<double>(state.displacement.size());
    }
    EXPECT_NEAR(mean, inward, 0.02 * inward);
  }
}

TEST(Nonlinear, OneLinearisationPerStepIsWhatItSays) {
  Grid grid;
  Model model = strip(10, 8, grid);
  model.loads.push_back({0, EdgeLoad{{{grid.node(8, 0), grid.node(8, 1)}}, Vec3(0, 0, 1e-4)}, {}});
  RunSettings settings = nonlinear_run({0.25, 0.5, 0.75, 1});
  settings.newton_max = 1;
  State state;
  const Summary summary = solve(model, settings, [&](const State& s) { state = s; });
  EXPECT_EQ(summary.newton_iterations, 4U);
  EXPECT_FALSE(summary.converged);
  EXPECT_GT(summary.residual, 1e-8);
}

TEST(Nonlinear, SmallLoadsGiveProportionalDisplacements) {
  Grid grid;
  std::array<double, 2> deflections{};
  for (std::size_t k = 0; k < 2; ++k) {
    Model model = strip(10, 8, grid);
    const double load = k == 0 ? 1e-3 : 1e-9;
    model.loads.push_back({0, EdgeLoad{{{grid.node(8, 0), grid.node(8, 1)}}, Vec3(0, 0, load)}, {}});
    deflections[k] = last_state(model, nonlinear_run({1})).displacement[grid.node(8, 0)].z() / load;
  }
  EXPECT_NEAR(deflections[1] / deflections[0], 1, 1e-5);
}

TEST(Nonlinear, LoadFreeStateStaysAtRest) {
  Grid grid;
  const Model model = strip(10, 4, grid);
  const State state = last_state(model, nonlinear_run({1}));
  for (const Vec3& u : state.displacement) {
    EXPECT_EQ(u, Vec3::Zero());
  }
}

TEST(Nonlinear, PrescribedDisplacementIsReached) {
  Grid grid;
  Model model = strip(10, 8, grid);
  model.fixes.push_back(
      {0, {grid.node(8, 0), grid.node(8, 1)}, {false, false, true}, {false, false, false}, Vec3(0, 0, 4), {}});
  const State state = last_state(model, nonlinear_run({0.5, 1}));
  EXPECT_NEAR(state.displacement[grid.node(8, 0)].z(), 4, 1e-12);
  EXPECT_GT(state.strain_energy, 0);
}

TEST(Nonlinear, ConjugateGradientsAgreeWithTheDirectSolver) {
  Grid grid;
  Model model = strip(10, 8, grid);
  model.loads.push_back({0, EdgeLoad{{{grid.node(8, 0), grid.node(8, 1)}}, Vec3(0, 0, 0.4)}, {}});
  RunSettings settings = nonlinear_run({1});
  const double direct = last_state(model, settings).displacement[grid.node(8, 0)].z();
  settings.solver = Solver::cg;
  const double iterative = last_state(model, settings).displacement[grid.node(8, 0)].z();
  EXPECT_NEAR(iterative, direct, 1e-6 * direct);
  settings.cg_fixed_count = true;
  settings.cg_iterations = 5;
  settings.newton_max = 1;
  const State stopped = last_state(model, settings);
  EXPECT_FALSE(stopped.converged);
  EXPECT_EQ(stopped.cg_iterations, 5U);
}

TEST(Dynamics, FreeVibrationDecaysUnderBackwardEulerAndKeepsItsPeriod) {
  // A cantilever strip, first mode: omega = 1.8751^2 sqrt(E I / (rho A)) / L^2, let go from under a tip load.
  Grid grid;
  Model model = strip(10, 8, grid);
  model.shells[0].material.density = 1e-9;
  const double omega = 1.8751 * 1.8751 / 100 * std::sqrt(1.2e6 * 0.1 * 0.1 / 12 / 1e-9);
  const double period = 2 * pi / omega;
  model.loads.push_back(
      {0, EdgeLoad{{{grid.node(8, 0), grid.node(8, 1)}}, Vec3(0, 0, 1e-3)}, {{{0, 1}, {1e-12, 1}, {2e-12, 0}}}});
  // One short step under the load sets it off.
  model.loads[0].ramp = {{{0, 1}, {0.02 * period, 1}, {0.021 * period, 0}}};
  RunSettings settings;
  settings.kind = DynamicRun{2 * period, period / 200, {}, Integrator::backward_euler};
  std::vector<double> tip;
  std::vector<double> energy;
  solve(model, settings, [&](const State& state) {
    tip.push_back(state.displacement[grid.node(8, 0)].z());
    energy.push_back(state.kinetic_energy + state.strain_energy);
  });
  for (std::size_t i = 6; i < energy.size(); ++i) {
    EXPECT_LE(energy[i], energy[i - 1] * (1 + 1e-6));
  }
  std::vector<std::size_t> crossings;
  for (std::size_t i = 20; i < tip.size(); ++i) {
    if (tip[i - 1] < 0 && tip[i] >= 0) {
      crossings.push_back(i);
    }
  }
  ASSERT_FALSE(crossings.empty());
  EXPECT_NEAR(static_cast<double>(crossings[0]) / 200, 1, 0.05);
}

TEST(Dynamics, BalloonSettlesAtItsStaticEquilibrium) {
  Model model = pressurised_sphere(1, 1, 0.5);
  const double at_rest = last_state(model, nonlinear_run({1})).displacement[0].norm();
  model.shells[0].material.density = 1.1e-9;
  RunSettings settings;
  settings.kind = DynamicRun{0.4, 0.04, {}, Integrator::backward_euler};
  EXPECT_NEAR(last_state(model, settings).displacement[0].norm(), at_rest, 1e-6 * at_rest);
}

}  // namespace
}  // namespace tunica
