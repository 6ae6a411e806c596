// Integrators: their order, what they damp, rigid rotation, error control, and going on from a checkpoint.

#include "benchmarks.hpp"
#include "tunica/core/error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

constexpr double first_root = 1.87510407;  // of 1 + cos cosh = 0: the first mode of a cantilever

/// A cantilever strip, 10 x 1 x 0.1, whose end is pressed and let go softly within the first half of its period.
struct Cantilever {
  Model model;
  Grid grid;
  double period = 0;

  explicit Cantilever(double force = 1e-3) {
    grid = make_grid(6, 1, [](double u, double v) { return Vec3(10 * u, v, 0); });
    model.shells.push_back(flat_body(grid.mesh, 1.2e6, 0, 0.1));
    model.shells[0].material.density = 1e-9;
    hold(
        model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
    const double omega =
        first_root * first_root / 100 * std::sqrt(1.2e6 * 0.1 * 0.1 / 12 / model.shells[0].material.density.value());
    period = 2 * pi / omega;
    Ramp pulse;
    for (int k = 0; k <= 400; ++k) {  // smooth enough for a second-order scheme to show its order
      const double s = k / 400.0;
      pulse.points.emplace_back(0.5 * period * s, std::pow(std::sin(pi * s), 4));
    }
    model.loads.push_back({0, EdgeLoad{{{grid.node(6, 0), grid.node(6, 1)}}, Vec3(0, 0, force)}, pulse});
  }

  [[nodiscard]] RunSettings settings(Integrator integrator, double radius, double duration, double steps_per_period,
                                     Damping damping = {}) const {
    RunSettings result;
    DynamicRun run;
    run.duration = duration * period;
    run.step = period / steps_per_period;
    run.damping = damping;
    run.integrator = integrator;
    run.spectral_radius = radius;
    result.kind = run;
    return result;
  }

  [[nodiscard]] double tip(const State& state) const { return state.displacement[grid.node(6, 0)].z(); }
};

/// Order seen in the tip's place after one and a half periods, from three steps of which each is half of the one
/// before.
double order(const Cantilever& strip, Integrator integrator, double radius, Damping damping, double coarsest) {
  std::vector<double> tips;
  for (const double steps : {coarsest, 2 * coarsest, 4 * coarsest}) {
    tips.push_back(strip.tip(last_state(strip.model, strip.settings(integrator, radius, 1.5, steps, damping))));
  }
  return std::log2((tips[1] - tips[0]) / (tips[2] - tips[1]));
}

TEST(Integrators, HaveTheirOrder) {
  const Cantilever strip(0.02);  // large enough for finite rotations: the tip moves by a tenth of the length
  const double omega = 2 * pi / strip.period;
  EXPECT_NEAR(order(strip, Integrator::generalised_alpha, 1, {}, 160), 2, 0.15);
  EXPECT_NEAR(order(strip, Integrator::generalised_alpha, 0.5, {}, 160), 2, 0.15);
  EXPECT_NEAR(order(strip, Integrator::generalised_alpha, 0.8, {0.1 * omega, 0}, 160), 2, 0.15);
  EXPECT_NEAR(order(strip, Integrator::generalised_alpha, 0.8, {0, 0.1 / omega}, 160), 2, 0.15);
  EXPECT_NEAR(order(strip, Integrator::backward_euler, 0, {}, 400), 1, 0.15);
}

TEST(Integrators, DampAsMuchAsTheyAreAskedTo) {
  const Cantilever strip;
  const auto kept = [&](Integrator integrator, double radius) {
    double after_pulse = 0;
    double last = 0;
    solve(strip.model, strip.settings(integrator, radius, 8.5, 40), [&](const State& state) {
      last = state.kinetic_energy + state.strain_energy;
      if (state.time < 0.51 * strip.period) {
        after_pulse = last;
      }
    });
    return last / after_pulse;
  };
  EXPECT_NEAR(kept(Integrator::generalised_alpha, 1), 1, 0.002);
  EXPECT_GT(kept(Integrator::generalised_alpha, 0.8), 0.97);
  EXPECT_LT(kept(Integrator::generalised_alpha, 0), 0.97);
  EXPECT_LT(kept(Integrator::backward_euler, 0), 0.01);
}

TEST(Integrators, KeepThePeriod) {
  // Zero crossings of the free tip; the scheme's own error at 60 steps a period is (omega h)^2 / 12 = 0.1 %.
  const Cantilever strip;
  std::vector<double> crossings;
  double before = 0;
  double time = 0;
  solve(strip.model, strip.settings(Integrator::generalised_alpha, 1, 8, 60), [&](const State& state) {
    const double now = strip.tip(state);
    if (state.time > 0.6 * strip.period && before < 0 && now >= 0) {
      crossings.push_back(time + (state.time - time) * before / (before - now));
    }
    before = now;
    time = state.time;
  });
  ASSERT_GT(crossings.size(), 5U);
  const double measured = (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
  EXPECT_NEAR(measured / strip.period, 1, 0.02);  // six elements with lumped masses
}

/// A free stiff square plate in the x-y plane that a couple spins up about x.
struct Spinner {
  Model model;
  double inertia = 0;  ///< tonne mm^2 about x: m L^2 / 12 + m t^2 / 12 in the limit; here of the lumped masses
  static constexpr double moment = 0.2;
  static constexpr double duration = 1e-2;  ///< s, of the couple
  static constexpr double side = 10;

  Spinner() {
    const Grid grid = make_grid(
        4, 4, [](double u, double v) { return Vec3(side * u, side * v, 0); },
        Diagonals::alternating);  // so that x is a principal axis of the lumped masses too
    model.shells.push_back(flat_body(grid.mesh, 2e6, 0.3, 2));
    model.shells[0].material.density = 1e-8;
    std::vector<Index> all(grid.mesh.vertices.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] = static_cast<Index>(i);
    }
    Ramp pulse;
    for (int k = 0; k <= 100; ++k) {
      const double s = k / 100.0;
      pulse.points.emplace_back(duration * s, 2 * std::pow(std::sin(pi * s), 2));
    }
    model.loads.push_back({0, MomentLoad{all, Vec3(moment, 0, 0)}, pulse});
    for (const auto& t : grid.mesh.triangles) {
      const Vec3 a = grid.mesh.vertices[t[0]], b = grid.mesh.vertices[t[1]], c = grid.mesh.vertices[t[2]];
      const double mass = 1e-8 * 2 * 0.5 * (b - a).cross(c - a).norm();
      for (const Vec3& p : {a, b, c}) {
        inertia += mass / 3 * ((p.y() - side / 2) * (p.y() - side / 2) + 2.0 * 2.0 / 12);
      }
    }
  }
};

TEST(Integrators, ARigidBodyTurnsAsItsImpulseSays) {
  const Spinner spinner;
  for (const double step : {1e-3, 5e-4}) {
    RunSettings settings;
    DynamicRun run;
    const double omega = Spinner::moment * Spinner::duration / spinner.inertia;
    run.step = step;
    run.duration = Spinner::duration + 4 * 2 * pi / omega;  // four turns after the couple
    run.integrator = Integrator::generalised_alpha;
    run.spectral_radius = 0.9;
    settings.kind = run;
    std::vector<double> energies;
    Vec3 turning = Vec3::Zero();
    solve(spinner.model, settings, [&](const State& state) {
      if (state.time > 1.05 * Spinner::duration) {
        energies.push_back(state.kinetic_energy + state.strain_energy);
      }
      turning.setZero();
      for (const Vec3& w : state.angular_velocity) {
        turning += w / static_cast<double>(state.angular_velocity.size());
      }
    });
    // Rotational energy of the impulse, and no drift: the scheme's centripetal error is of the order (omega h)^2 / 12.
    const double wanted = 0.5 * spinner.inertia * omega * omega;
    const double error = std::pow(omega * run.step, 2);
    EXPECT_NEAR(energies.front() / wanted, 1, error);
    EXPECT_NEAR(energies.back() / energies.front(), 1, 0.5 * error);
    EXPECT_NEAR(turning.x() / omega, 1, error);
    EXPECT_LT(std::abs(turning.y()) + std::abs(turning.z()), 1e-6 * omega);
  }
}

struct Balanced {
  EnergyBalance energy;
  std::vector<double> stored;
};

Balanced balance(const Model& model, const RunSettings& settings) {
  Balanced result;
  result.energy = solve(model, settings, [&](const State& state) {
                    result.stored.push_back(state.kinetic_energy + state.strain_energy);
                  }).energy.value();
  return result;
}

TEST(Energy, IsBalanced) {
  const Cantilever strip(0.02);
  const double omega = 2 * pi / strip.period;
  const Balanced free = balance(strip.model, strip.settings(Integrator::generalised_alpha, 1, 3, 120));
  EXPECT_GT(free.energy.work, 0);
  EXPECT_EQ(free.energy.damped, 0);
  EXPECT_LT(std::abs(free.energy.lost), 0.01 * free.energy.work);
  EXPECT_LT(free.energy.gained, 0.01);
  for (const Damping& damping : {Damping{0.1 * omega, 0}, Damping{0, 0.1 / omega}}) {
    const Balanced damped = balance(strip.model, strip.settings(Integrator::generalised_alpha, 1, 3, 120, damping));
    EXPECT_GT(damped.energy.damped, 0.3 * damped.energy.work);
    EXPECT_LT(std::abs(damped.energy.lost), 0.02 * damped.energy.work);
    EXPECT_NEAR(damped.energy.work - damped.energy.damped - damped.energy.lost, damped.stored.back(),
                1e-9 * damped.energy.work);
  }
  const Balanced eaten = balance(strip.model, strip.settings(Integrator::backward_euler, 0, 3, 40));
  EXPECT_GT(eaten.energy.lost, 0.8 * eaten.energy.work);
  EXPECT_EQ(eaten.energy.gaining_step, 0U);
}

TEST(Energy, OfPrescribedMotionIsWorkToo) {
  // The clamped end is lifted and kept there: what the supports bring in is in the strip, or was damped.
  Cantilever strip;
  strip.model.loads.clear();
  Fix lifted = strip.model.fixes[0];
  lifted.displacement = Vec3(0, 0, 1);
  for (int k = 0; k <= 100; ++k) {
    lifted.ramp.points.emplace_back(0.2 * strip.period * k / 100, std::pow(std::sin(pi / 2 * k / 100), 2));
  }
  strip.model.fixes = {lifted};
  const Balanced moved =
      balance(strip.model, strip.settings(Integrator::generalised_alpha, 1, 2, 400, {0.5 / strip.period, 0}));
  EXPECT_GT(moved.energy.work, 0);
  EXPECT_LT(std::abs(moved.energy.lost), 0.02 * moved.energy.work);
}

TEST(Energy, GainedByTimeIntegrationIsNamedWithItsStep) {
  // Steps too coarse for a large motion: every one converges, and the strip comes to hold more energy than it was
  // given.
  const Cantilever strip(0.5);
  const Balanced wild = balance(strip.model, strip.settings(Integrator::generalised_alpha, 0.8, 12, 8));
  const double given = wild.stored[5];  // after the pulse
  const auto first =
      std::find_if(wild.stored.begin() + 5, wild.stored.end(), [&](double e) { return e > 1.1 * given; });
  ASSERT_NE(first, wild.stored.end());
  EXPECT_GT(wild.energy.gained, 0.1);
  ASSERT_GT(wild.energy.gaining_step, 5U);
  EXPECT_LE(wild.energy.gaining_step, static_cast<std::size_t>(first - wild.stored.begin()));
  EXPECT_NEAR(wild.energy.gaining_time, strip.period / 8 * static_cast<double>(wild.energy.gaining_step),
              1e-9 * strip.period);
  const Balanced tame = balance(strip.model, strip.settings(Integrator::generalised_alpha, 0.8, 12, 16));
  EXPECT_EQ(tame.energy.gaining_step, 0U);
}

TEST(Adaptive, KeepsTheErrorWithTheStepsItNeeds) {
  const Cantilever strip(0.02);
  for (const Integrator integrator : {Integrator::generalised_alpha, Integrator::backward_euler}) {
    RunSettings fine = strip.settings(Integrator::generalised_alpha, 1, 1.5, 2400);
    const double truth = strip.tip(last_state(strip.model, fine));
    std::vector<double> errors;
    std::vector<double> parts;
    const double tightest = integrator == Integrator::backward_euler ? 5e-4 : 2e-5;
    const double looser = integrator == Integrator::backward_euler ? 4 : 8;
    for (const double tolerance : {looser * tightest, tightest}) {
      RunSettings settings = strip.settings(integrator, 1, 1.5, 12);
      std::get<DynamicRun>(settings.kind).adaptive = LengthTolerance{tolerance, false};
      State last;
      const Summary summary = solve(strip.model, settings, [&](const State& state) { last = state; });
      EXPECT_EQ(summary.steps, 18U);
      errors.push_back(std::abs(strip.tip(last) - truth));
      parts.push_back(static_cast<double>(summary.parts));
    }
    // The local error falls with the square or the cube of the step.
    EXPECT_NEAR(parts[1] / parts[0], 2, 0.4);
    EXPECT_LT(errors[1], 0.7 * errors[0]);
    EXPECT_LT(errors[1], 3 * tightest * parts[1]);
  }
}

/// Both ends of the step, and its middle, see no load.
TEST(Adaptive, APulseWithinAStepIsFollowed) {
  Cantilever strip;
  const double t = strip.period;
  strip.model.loads[0].ramp.points = {{0.04 * t, 0}, {0.06 * t, 1}, {0.08 * t, 0}};
  const double truth = strip.tip(last_state(strip.model, strip.settings(Integrator::generalised_alpha, 1, 0.5, 1000)));
  RunSettings settings = strip.settings(Integrator::generalised_alpha, 1, 0.5, 4);
  std::get<DynamicRun>(settings.kind).adaptive = LengthTolerance{5e-7, false};
  EXPECT_NEAR(strip.tip(last_state(strip.model, settings)), truth, 0.03 * std::abs(truth));
}

TEST(Adaptive, OneToleranceThatAnyStepMeetsChangesNothing) {
  const Cantilever strip;
  RunSettings settings = strip.settings(Integrator::generalised_alpha, 0.8, 0.5, 40);
  const State plain = last_state(strip.model, settings);
  std::get<DynamicRun>(settings.kind).adaptive = LengthTolerance{1, true};
  const State adapted = last_state(strip.model, settings);
  EXPECT_EQ(plain.displacement, adapted.displacement);
}

TEST(Adaptive, ALoadThatJumpsWhereNothingMayIsRefused) {
  Cantilever strip;
  strip.model.loads[0].ramp = {};
  RunSettings settings = strip.settings(Integrator::backward_euler, 0, 0.1, 10);
  std::get<DynamicRun>(settings.kind).adaptive = LengthTolerance{1e-16, false};
  try {
    last_state(strip.model, settings);
    FAIL();
  } catch (const RequirementError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("adaptive"));
  }
}

TEST(Resumption, OfEveryIntegratorIsTheSameToTheBit) {
  const Cantilever strip(0.02);
  const double omega = 2 * pi / strip.period;
  for (const Integrator integrator : {Integrator::generalised_alpha, Integrator::backward_euler}) {
    RunSettings settings = strip.settings(integrator, 0.7, 0.6, 40, {0.01 * omega, 0.05 / omega});
    std::get<DynamicRun>(settings.kind).adaptive = LengthTolerance{1e-4, false};
    settings.solver = Solver::direct;
    std::optional<Checkpoint> kept;
    Resumption keeping;
    keeping.on_step = [&](const std::function<Checkpoint()>& make) {
      Checkpoint checkpoint = make();
      if (checkpoint.summary.steps == 11) {
        kept = std::move(checkpoint);
      }
    };
    State whole;
    const Summary uninterrupted = solve(
        strip.model, settings, [&](const State& state) { whole = state; }, {}, keeping);
    ASSERT_TRUE(kept);
    State resumed;
    const Summary rest = solve(
        strip.model, settings, [&](const State& state) { resumed = state; }, {}, Resumption{kept, {}});
    EXPECT_EQ(whole.displacement, resumed.displacement);
    EXPECT_EQ(whole.velocity, resumed.velocity);
    EXPECT_EQ(uninterrupted.parts, rest.parts);
  }
}

TEST(Integrators, ComeToRestWhereTheStaticRunDoes) {
  Model model;
  ShellBody body = flat_body(make_vessel(16, 12), 1, 0.45, 1);
  body.curved = true;
  body.rest = Rest::curved;
  body.material.density = 1.1e-9;
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& p) { return p.z() < 1e-9 || p.z() > 60 - 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{1e-3, true}, Ramp{{{0, 0}, {1, 1}}}});
  RunSettings settings;
  DynamicRun run;
  run.duration = 2;
  run.step = 0.04;
  run.integrator = Integrator::generalised_alpha;
  run.spectral_radius = 0.3;
  settings.kind = run;
  const State moving = last_state(model, settings);
  const State rest = last_state(model, nonlinear_run({1}));
  for (std::size_t i = 0; i < rest.displacement.size(); ++i) {
    EXPECT_LT((moving.displacement[i] - rest.displacement[i]).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace tunica
