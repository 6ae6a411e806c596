// What contact needs of time: runs that go on from a checkpoint, and ways that turn within a step.

#include "tets.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

/// A plate, 10 x 10 mm, held at its border, and a rigid ball whose way over it is given.
Model plate_and_ball(std::vector<std::pair<double, Vec3>> way, double friction) {
  const Grid grid = make_grid(8, 8, [](double u, double v) { return Vec3(10 * u - 5, 10 * v - 5, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1, 0.45, 0.5));
  model.shells[0].material.density = 1e-9;
  hold(
      model, [](const Vec3& p) { return std::max(std::abs(p.x()), std::abs(p.y())) > 5 - eps; }, "xyz", "xyz");
  RigidSphere ball;
  ball.centre.points = std::move(way);
  ball.radius.points = {{0, 2}};
  model.rigids.push_back({"ball", ball, {}, {}});
  Contact contact;
  contact.name = "c";
  contact.between = {ContactParty{true, 0}, ContactParty{false, 0}};
  contact.friction = friction;
  model.contacts.push_back(contact);
  return model;
}

RunSettings motion(double duration, double step, Integrator integrator = Integrator::backward_euler) {
  RunSettings settings;
  DynamicRun run;
  run.duration = duration;
  run.step = step;
  run.integrator = integrator;
  settings.kind = run;
  settings.solver = Solver::direct;
  return settings;
}

/// Runs once, and again from the checkpoint after each step.
void expect_same_from_every_checkpoint(const Model& model, const RunSettings& settings) {
  std::vector<Checkpoint> kept;
  State whole;
  Resumption keeping;
  keeping.on_step = [&](const std::function<Checkpoint()>& make) { kept.push_back(make()); };
  const Summary summary = solve(
      model, settings, [&](const State& state) { whole = state; }, {}, keeping);
  ASSERT_EQ(kept.size(), summary.steps);
  ASSERT_GT(whole.contacts.at(0).slip, 0.1);
  kept.pop_back();
  for (const Checkpoint& from : kept) {
    State resumed;
    const Summary again = solve(
        model, settings, [&](const State& state) { resumed = state; }, {}, Resumption{from, {}});
    EXPECT_EQ(again.newton_iterations, summary.newton_iterations) << from.position;
    for (std::size_t i = 0; i < whole.displacement.size(); ++i) {
      ASSERT_NEAR((whole.displacement[i] - resumed.displacement[i]).norm(), 0, 1e-10) << from.position;
    }
    EXPECT_NEAR((whole.contacts[0].force - resumed.contacts[0].force).norm() / whole.contacts[0].force.norm(), 0, 1e-10)
        << from.position;
    EXPECT_NEAR(whole.contacts[0].slip, resumed.contacts[0].slip, 1e-10) << from.position;
  }
}

TEST(ContactInTime, RubbingRunsGoOnAsIfNothingHadHappened) {
  const auto way = [](double end) {
    return std::vector<std::pair<double, Vec3>>{{0, {-1, 0, 2.3}}, {0.2 * end, {-1, 0, 1.9}}, {end, {1, 0.5, 1.7}}};
  };
  expect_same_from_every_checkpoint(plate_and_ball(way(1), 0.3), [] {
    RunSettings settings = nonlinear_run({0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1});
    settings.solver = Solver::direct;
    return settings;
  }());
  expect_same_from_every_checkpoint(plate_and_ball(way(0.02), 0.3), motion(0.02, 2e-3));
  expect_same_from_every_checkpoint(plate_and_ball(way(0.02), 0.3), motion(0.02, 2e-3, Integrator::generalised_alpha));
}

struct Seen {
  double moved = 0;  ///< mm, of the node that moved most, at the end
  std::size_t parts = 0;
  double energy = 0;
};

Seen seen(const Model& model, const RunSettings& settings) {
  Seen result;
  const Summary summary = solve(model, settings, [&](const State& state) {
    result.moved = 0;
    for (const Vec3& u : state.displacement) {
      result.moved = std::max(result.moved, u.norm());
    }
  });
  result.parts = summary.parts;
  result.energy = summary.energy ? summary.energy->work : 0;
  return result;
}

TEST(ContactInTime, AWayThatTurnsWithinAStepIsFollowed) {
  const Model model = plate_and_ball({{0, {0, 0, 2.3}}, {2e-3, {0, 0, 1.3}}, {4e-3, {0, 0, 2.3}}}, 0);
  const Seen coarse = seen(model, motion(4e-3, 4e-3));
  EXPECT_EQ(coarse.parts, 2U);
  EXPECT_GT(coarse.moved, 0.02);  // it swings back from what the ball pushed
  EXPECT_EQ(seen(model, motion(4e-3, 2e-3)).moved, coarse.moved);
}

TEST(ContactInTime, WhatTouchesWithinAStepOnlyIsCounted) {
  const auto pressed = [](double lowest) {
    const Model model = plate_and_ball({{0, {0, 0, 2.6}}, {1e-3, {0, 0, lowest}}, {2e-3, {0, 0, 2.6}}}, 0);
    std::size_t points = 0;
    const Summary summary =
        solve(model, motion(4e-3, 4e-3), [&](const State& state) { points += state.contacts[0].points; });
    EXPECT_EQ(points, 0U);
    return summary.contact_pressures.at(0);
  };
  EXPECT_GT(pressed(2.0), 0);
  EXPECT_EQ(pressed(2.4), 0);
}

TEST(ContactInTime, APrescribedWayThatTurnsWithinAStepIsFollowed) {
  // The border of the plate goes down onto a ball at rest and back.
  for (const bool moves : {false, true}) {
    Model model = plate_and_ball({{0, {0, 0, -2.4}}}, 0);
    model.fixes[0].displacement = Vec3(0, 0, -1);
    const double end = moves ? 4e-3 : 1;
    model.fixes[0].ramp.points = {{0, 0}, {0.5 * end, 1}, {end, 0}};
    if (moves) {
      EXPECT_EQ(seen(model, motion(end, end)).parts, 2U);
    } else {
      std::size_t iterations = 0;
      solve(model, nonlinear_run({1}), [&](const State& state) { iterations += state.newton_iterations; });
      EXPECT_GT(iterations, 4U);
    }
  }
}

TEST(ContactInTime, ALoadThatRisesAndFallsWithinAStepDoesWork) {
  Model model = plate_and_ball({{0, {0, 0, 50}}}, 0);
  Load load;
  load.kind = PressureLoad{1e-3, true};
  load.ramp.points = {{1e-3, 0}, {2e-3, 1}, {3e-3, 0}};
  model.loads.push_back(load);
  EXPECT_GT(seen(model, motion(4e-3, 4e-3)).energy, 0);
  EXPECT_EQ(seen(model, motion(4e-3, 4e-3)).parts, 4U);
  // What every step sees anyway cuts none: a ramp of many entries on a smooth curve.
  load.ramp.points.clear();
  for (int k = 0; k <= 400; ++k) {
    load.ramp.points.emplace_back(1e-5 * k, 1 - std::cos(pi * k / 400));
  }
  model.loads[0] = load;
  EXPECT_EQ(seen(model, motion(4e-3, 1e-4)).parts, 40U);
}

/// A plate of .4 mg falls .2 mm under gravity onto a plane: never more than m g h swings, and it comes back no higher
/// than it began.
TEST(Energy, OfAFallIsNotGainedByAnImpact) {
  constexpr double height = 0.2, gravity = 9810, energy = 4e-7 * gravity * height;
  const Grid grid = make_grid(6, 6, [](double u, double v) { return Vec3(20 * u, 20 * v, 0.5 + height); });
  for (const double young : {1.0, 100.0}) {
    for (const Integrator integrator : {Integrator::backward_euler, Integrator::generalised_alpha}) {
      Model model;
      model.shells.push_back(flat_body(grid.mesh, young, 0.3, 1));
      model.shells[0].material.density = 1e-9;
      model.loads.push_back({0, GravityLoad{Vec3(0, 0, -gravity)}, {}});
      model.rigids.push_back({"floor", RigidPlane{{{{0, Vec3::Zero()}}}, Vec3::UnitZ()}, {}, {}});
      Contact contact;
      contact.name = "c";
      contact.between = {ContactParty{false, 0}, ContactParty{true, 0}};
      model.contacts.push_back(contact);
      double swings = 0, rises = 0;
      const Summary summary = solve(model, motion(0.02, 1e-4, integrator), [&](const State& state) {
        swings = std::max(swings, state.kinetic_energy + state.strain_energy);
        for (const Vec3& u : state.displacement) {
          rises = std::max(rises, u.z());
        }
      });
      EXPECT_LT(swings, 1.1 * energy) << young;
      EXPECT_LT(rises, 0.05 * height) << young;
      EXPECT_GT(summary.contact_pressures.at(0), 0);
      EXPECT_LT(summary.energy->gained, 0.1) << young;
      EXPECT_LT(summary.energy->work, 1.001 * energy) << "gravity does no more";
    }
  }
}

/// A block of 500 mg falls .3 mm, flat or onto an edge: what stands behind the face that strikes is stopped, too.
TEST(Energy, OfABlockThatFallsIsNotGainedByAnImpact) {
  constexpr double height = 0.3, gravity = 9810;
  for (const double turned : {0.0, 0.35}) {
    const Mat3 turn = Eigen::AngleAxisd(turned, Vec3::UnitY()).toRotationMatrix();
    TetMesh block =
        make_block(2, 2, 1, [&](const Vec3& u) { return Vec3(turn * Vec3(10 * u.x(), 10 * u.y(), 5 * u.z())); });
    double lowest = infinity;
    for (const Vec3& p : block.vertices) {
      lowest = std::min(lowest, p.z());
    }
    for (const Integrator integrator : {Integrator::backward_euler, Integrator::generalised_alpha}) {
      Model model = one_solid(block, 1, 0.3);
      model.solids[0].material.density = 1e-9;
      model.loads.push_back({0, GravityLoad{Vec3(0, 0, -gravity)}, {}});
      model.rigids.push_back({"floor", RigidPlane{{{{0, Vec3(0, 0, lowest - height)}}}, Vec3::UnitZ()}, {}, {}});
      Contact contact;
      contact.name = "c";
      contact.between = {ContactParty{false, 0}, ContactParty{true, 0}};
      model.contacts.push_back(contact);
      const Summary summary = solve(model, motion(0.012, 5e-5, integrator), [](const State&) {});
      EXPECT_GT(summary.contact_pressures.at(0), 0);
      EXPECT_LT(summary.energy->gained, 0.03) << turned;
    }
  }
}

TEST(Energy, IsNotGainedByWhatIsDamped) {
  for (const Integrator integrator : {Integrator::backward_euler, Integrator::generalised_alpha}) {
    for (const Damping damping : {Damping{0, 0}, Damping{300, 0}, Damping{0, 2e-3}, Damping{100, 1e-3}}) {
      for (const double ramp : {0.0, 2e-3, 20e-3}) {
        Model model = pressurised_sphere(2, 0.5, 1e-3);
        model.shells[0].material = {1, 0.45, 1.1e-9};
        if (ramp > 0) {
          model.loads[0].ramp.points = {{0, 0}, {ramp, 1}};
        }
        RunSettings settings = motion(0.04, 2e-3, integrator);
        std::get<DynamicRun>(settings.kind).damping = damping;
        const Summary summary = solve(model, settings, [](const State&) {});
        EXPECT_LT(summary.energy->gained, 0.05) << damping.mass << " " << damping.stiffness << " " << ramp;
        EXPECT_EQ(summary.energy->gaining_step, 0U);
        EXPECT_EQ(summary.energy->damped > 0, damping.mass + damping.stiffness > 0);
      }
    }
  }
}

}  // namespace
}  // namespace tunica
