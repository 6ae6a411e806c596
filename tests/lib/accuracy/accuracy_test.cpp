// Claims against analytic answers; what must not be believed is not.
#include "tunica/accuracy/accuracy.hpp"

#include "mechanics/benchmarks.hpp"
#include "tunica/accuracy/detail/levels.hpp"
#include "tunica/accuracy/estimates.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr double radius = 10, thickness = 0.5, young = 1000, poisson = 0.3;

RunSettings at_rest() {
  RunSettings settings;
  settings.kind = StaticRun{false, {1}};
  return settings;
}

/// A sphere under pressure, which the membrane theory knows.
struct Sphere {
  Target target{flat_facets(benchmarks::make_sphere(radius, 5))};
  Model model = benchmarks::pressurised_sphere(1, thickness, 0.01);
  std::map<std::size_t, double> factors{};  // of the pressure, by shells
  RunSettings settings = at_rest();

  [[nodiscard]] double exact(Quantity of) const {
    const double u = 0.01 * radius * radius * (1 - poisson) / (2 * young * thickness);
    const double area = 4 * std::numbers::pi * radius * radius;
    return of == Quantity::displacement ? u
           : of == Quantity::energy     ? area * 0.01 * u / 2
           : of == Quantity::volume     ? area * u
                                        : 0.01 * radius / (2 * thickness);
  }

  [[nodiscard]] Accuracy solved(const AccuracyRequest& request) const {
    return solve_within(model.shells, {&target}, request, settings, [&](std::vector<ShellBody> bodies) {
      Model finer = model;
      const auto factor = factors.find(bodies.front().mesh.triangles.size());
      std::get<PressureLoad>(finer.loads.front().kind).value *= factor == factors.end() ? 1 : factor->second;
      finer.shells = std::move(bodies);
      return finer;
    });
  }
};

TEST(Accuracy, ASphereUnderPressureIsWithinWhatIsClaimed) {
  const Sphere sphere;
  for (const Quantity of : {Quantity::displacement, Quantity::energy, Quantity::volume, Quantity::stress}) {
    const Accuracy found = sphere.solved({0.02, of});
    ASSERT_TRUE(found.reasons.empty()) << found.reasons.front();
    const double error = std::abs(found.levels.back().value / sphere.exact(of) - 1);
    // The 99th percentile of a constant stress is one of its noise, which falls to first order.
    EXPECT_LT(error, (of == Quantity::stress ? 1.25 : 1) * *found.estimate);
    EXPECT_LT(*found.estimate, 0.02);
    EXPECT_GE(found.levels.size(), 3U);
    EXPECT_EQ(found.system->model().shells.front().mesh.triangles.size(), found.levels.back().shells);
    EXPECT_EQ(found.states.size(), 2U);
    EXPECT_TRUE(found.summary.converged);
  }
}

TEST(Accuracy, APlaceThatTheMiddleOfTheWallDoesNotReachMakesTheStressOfFacesDoubtful) {
  TriangleMesh surface = flat_facets(benchmarks::make_sphere(radius, 6));
  surface.vertices[700] *= 1 + 0.95 * thickness / radius;
  const Sphere sphere{.target = Target{surface}};
  EXPECT_THAT(sphere.solved({0.05, Quantity::stress, 5120}).reasons,
              testing::Contains(testing::HasSubstr("a place of the surface lies")));
  const Accuracy volume = sphere.solved({0.05, Quantity::volume});
  EXPECT_THAT(volume.reasons, testing::IsEmpty());
  EXPECT_NEAR(volume.levels.back().value / sphere.exact(Quantity::volume), 1, 0.02);
}

TEST(Accuracy, APartThatNoShellsComeToIsDoubtful) {
  TriangleMesh surface = flat_facets(benchmarks::make_sphere(radius, 6));
  const auto count = narrow<Index>(surface.vertices.size());
  TriangleMesh part = flat_facets(benchmarks::make_sphere(0.15 * radius, 3));
  surface.vertices.insert(surface.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const auto& [a, b, c] : part.triangles) {
    surface.triangles.push_back({a + count, b + count, c + count});
  }
  const Sphere sphere{.target = Target{surface}};
  EXPECT_THAT(sphere.solved({0.05, Quantity::displacement, 5120}).reasons,
              testing::Contains(testing::HasSubstr("of the wall from the surface in the mean")));
}

TEST(Accuracy, WhereDisplacementsAreSmallTheLinearModelIsTaken) {
  Sphere sphere;
  EXPECT_TRUE(std::get<StaticRun>(sphere.solved({0.02}).settings.kind).linear);
  std::get<PressureLoad>(sphere.model.loads.front().kind).value = 3;  // strains of some per cent
  const Accuracy large = sphere.solved({0.02});
  EXPECT_FALSE(std::get<StaticRun>(large.settings.kind).linear);
  EXPECT_EQ(large.choices.back().instead, "linear");
}

/// A tube that is 1 % out of round, clamped at both ends: what rounds it off does so ever less, while the membrane
/// stress stays that of equilibrium.
TEST(Accuracy, TheLinearModelIsTakenWhereNoOtherAnswerChangesMuch) {
  for (const double pressure : {0.05e-3, 0.6e-3}) {
    const auto load = [&](std::vector<ShellBody> bodies) {
      Model model;
      model.shells = std::move(bodies);
      benchmarks::hold(
          model, [](const Vec3& p) { return p.z() < 1e-9 || p.z() > 30 - 1e-9; }, "xyz", "xyz");
      model.loads.push_back({0, PressureLoad{pressure, true}, {}});
      return model;
    };
    ShellBody tube = benchmarks::flat_body(benchmarks::tube_mesh(radius, 1.01 * radius, 30, 16, 10), 1, 0.45, 0.5);
    tube.curved = true;
    tube.rest = Rest::curved;
    const Accuracy found = solve_within({tube}, {nullptr}, {0.05, Quantity::membrane}, at_rest(), load);
    const bool linear = std::get<StaticRun>(found.settings.kind).linear;
    EXPECT_EQ(linear, pressure < 0.1e-3);
    if (!linear) {
      EXPECT_THAT(found.choices.back().would_cost, testing::HasSubstr("in max_displacement_mm"));
      continue;
    }
    const System system(found.system->model(), at_rest());
    State last;
    (void)solve(system, [&](const State& state) { last = state; });
    const Answers answers = answers_of(last, ElementFieldEvaluator(system)(last));
    for (const auto& [name, change] : changes(found.levels.back().answers, answers)) {
      EXPECT_LT(change, found.estimates.at(name).error) << name;
    }
  }
}

TEST(Accuracy, NewtonsMethodGoesOnFromTheCoarserLevel) {
  Sphere sphere;
  std::get<PressureLoad>(sphere.model.loads.front().kind).value = 1;
  const Accuracy found = sphere.solved({0.02});
  for (std::size_t level = 1; level < found.levels.size(); ++level) {
    EXPECT_LE(found.levels[level].newton_iterations, 4U);
  }
}

TEST(Accuracy, TwoLevelsThatAgreeByChanceAreNotBelieved) {
  Sphere sphere;
  const double first = sphere.solved({0.02}).levels[0].value, second = sphere.solved({0.02}).levels[1].value;
  sphere.factors = {{320, first / second}, {1280, 1.3}, {5120, 1.3}, {20480, 1.3}};
  const Accuracy found = sphere.solved({0.02, Quantity::displacement, 1280});
  EXPECT_NEAR(found.levels[1].value / found.levels[0].value, 1, 1e-3);
  EXPECT_GT(*found.estimate, 0.2);
  EXPECT_FALSE(found.reasons.empty());
  // And where the last two agree, the change before them counts.
  sphere.factors = {{80, 1.3}};
  EXPECT_GT(*sphere.solved({0.02, Quantity::displacement, 1280}).estimate, 0.05);
}

/// A thin tube clamped at its ends.
Model clamped_tube(std::vector<ShellBody> bodies) {
  Model model;
  ShellBody& body = bodies.front();
  body.thickness = {0.05};
  Fix fix;
  for (Index v = 0; v < body.mesh.vertices.size(); ++v) {
    if (std::abs(std::abs(body.mesh.vertices[v].z()) - 20) < 1e-9) {
      fix.nodes.push_back(v);
    }
  }
  model.fixes.push_back(fix);
  Load load;
  load.kind = PressureLoad{0.001, true};
  model.loads.push_back(load);
  model.shells = std::move(bodies);
  return model;
}

ShellBody tube_body() {
  ShellBody body = benchmarks::flat_body({}, young, poisson, 0.05);
  constexpr Index around = 48, along = 8;
  for (Index j = 0; j <= along; ++j) {
    for (Index i = 0; i < around; ++i) {
      const double angle = 2 * std::numbers::pi * i / around;
      body.mesh.normals.emplace_back(std::cos(angle), std::sin(angle), 0);
      body.mesh.vertices.emplace_back(radius * body.mesh.normals.back() + Vec3(0, 0, 40.0 * j / along - 20));
    }
  }
  for (Index j = 0; j < along; ++j) {
    for (Index i = 0; i < around; ++i) {
      const Index a = j * around + i, b = j * around + (i + 1) % around;
      body.mesh.triangles.push_back({a, b, b + around});
      body.mesh.triangles.push_back({a, b + around, a + around});
    }
  }
  body.mesh.patch = Patch::watertight;
  body.curved = true;
  body.rest = Rest::curved;
  return body;
}

/// Layers at held rims, which no level resolves, are left out of the stress: what is left is p r / t and its share
/// along.
TEST(Accuracy, ABendingLayerThatNoLevelResolvesDoesNotCount) {
  const Accuracy found =
      solve_within({tube_body()}, {nullptr}, {0.15, Quantity::stress, 12'288}, at_rest(), clamped_tube);
  EXPECT_TRUE(found.reasons.empty());
  EXPECT_LT(edges_per_layer(found.system->model()), 2);
  const double expected = 0.001 * radius / 0.05 * std::sqrt(1 - poisson + poisson * poisson);
  EXPECT_NEAR(found.levels.back().value, expected, 0.15 * expected);  // as was asked for
  EXPECT_EQ(edges_per_layer(benchmarks::pressurised_sphere(1, 0.5, 1)), infinity);
}

/// A bound of time makes the accuracy an aim: where finer shells have no answer, the run ends with the one before.
TEST(Accuracy, WithinABoundOfTimeARunEndsWithWhatThereIs) {
  const ModelOf few_only = [](std::vector<ShellBody> bodies) {
    if (bodies.front().mesh.triangles.size() > 5000) {
      throw InputError("they fold");
    }
    return clamped_tube(std::move(bodies));
  };
  AccuracyRequest request{0.001, Quantity::displacement, 50'000};
  EXPECT_THROW(solve_within({tube_body()}, {nullptr}, request, at_rest(), few_only), InputError);
  request.max_seconds = 1000;
  const Accuracy found = solve_within({tube_body()}, {nullptr}, request, at_rest(), few_only);
  EXPECT_EQ(found.levels.size(), 2U);
  ASSERT_EQ(found.reasons.size(), 1U);
  EXPECT_THAT(found.reasons.front(), ::testing::HasSubstr("no answer: they fold"));
  EXPECT_EQ(found.system->model().shells[0].mesh.triangles.size(), 3072U);
}

/// A column that buckles under its own weight, beyond 7.837 E I / L^3: levels that come to the same state agree.
TEST(Accuracy, ABuckledColumnIsWithinWhatIsClaimed) {
  constexpr double young = 1000, thickness = 0.1, length = 10;
  const double critical = 7.837 * young * std::pow(thickness / length, 3) / 12;
  const ModelOf column = [&](std::vector<ShellBody> bodies) {
    Model model;
    model.shells = std::move(bodies);
    benchmarks::hold(
        model, [](const Vec3& p) { return p.x() < 1e-9; }, "xyz", "xyz");
    model.loads.push_back({0, AreaLoad{Vec3(-1.3 * critical, 0, 0)}, {}});
    return model;
  };
  const benchmarks::Grid grid = benchmarks::make_grid(8, 1, [](double u, double v) { return Vec3(length * u, v, 0); });
  std::vector<ShellBody> body{benchmarks::flat_body(grid.mesh, young, 0, thickness)};
  body.front().mesh.normals.assign(body.front().mesh.vertices.size(), Vec3::UnitZ());
  body.front().curved = true;
  body.front().rest = Rest::curved;
  const auto found = [&](double within) {
    return solve_within(body, {nullptr}, {within, Quantity::displacement}, at_rest(), column);
  };
  const Accuracy coarse = found(0.05);
  EXPECT_TRUE(coarse.reasons.empty());
  EXPECT_EQ(coarse.summary.snaps.size(), 1U);
  const Accuracy exact = found(0.002);
  EXPECT_EQ(exact.summary.snaps.size(), 1U);  // of levels that begin from the one before, too
  const double fine = exact.levels.back().value;
  EXPECT_GT(fine, 1);
  EXPECT_NEAR(coarse.levels.back().value, fine, 0.05 * fine);
}

TEST(Accuracy, TooFewShellsForAnEstimateAreSaid) {
  const Accuracy found = Sphere().solved({0.02, Quantity::displacement, 500});
  EXPECT_FALSE(found.estimate);
  EXPECT_EQ(found.levels.size(), 2U);
  EXPECT_THAT(found.reasons.front(), ::testing::HasSubstr("takes 3 levels"));
}

TEST(Accuracy, WhatHasNoAnswerIsRefused) {
  EXPECT_THROW(solve_within({tube_body()}, {nullptr}, {0.02, Quantity::volume}, at_rest(), clamped_tube), InputError);
  Sphere sphere;
  std::get<PressureLoad>(sphere.model.loads.front().kind).value = 0;
  EXPECT_THROW(sphere.solved({0.02}), InputError);
}

// A 99th percentile that a finer mesh gives again is believed no more than what its neighbours do.
TEST(Estimates, APercentileThatAgreesByChanceIsNotBelieved) {
  Sphere sphere;
  const System system(sphere.model, sphere.settings);
  State last;
  (void)solve(system, [&](const State& state) { last = state; });
  ElementFields fields = ElementFieldEvaluator(system)(last);
  const auto estimate = [&] {
    return estimate_by_refinement(sphere.model, last, fields, {&sphere.target}, sphere.settings,
                                  [&](std::vector<ShellBody> bodies) {
                                    Model finer = sphere.model;
                                    finer.shells = std::move(bodies);
                                    return finer;
                                  })
        .estimates;
  };
  Estimates found = estimate();
  const double membrane = found["membrane_p99_mpa"].error, mean = found["membrane_mean_mpa"].error;
  EXPECT_LT(membrane, 0.2);
  EXPECT_TRUE(found["membrane_p99_mpa"].credible);
  EXPECT_FALSE(found["stress_max_mpa"].credible) << "the value at one place";
  fields.wall.beside.membrane[1] *= 1.5;
  found = estimate();
  EXPECT_GT(found["membrane_p99_mpa"].error, membrane + 0.3);
  EXPECT_FALSE(found["membrane_p99_mpa"].credible);
  EXPECT_EQ(found["membrane_mean_mpa"].error, mean);
}

/// At the clamped edges of a plate it converges with an order between one and two: by the second, the change to a finer
/// mesh would say too little.
TEST(Estimates, StressAtTheFacesOfACoarsePlateIsOffByLessThanIsSaid) {
  using namespace benchmarks;
  const auto plate = [](std::size_t n) {
    Model model;
    const auto place = [](double u, double v) { return Vec3(10 * u, 10 * v, 0); };
    model.shells.push_back(flat_body(make_grid(n, n, place, Diagonals::random).mesh, 1000, 0.3, 0.1));
    ShellMesh& mesh = model.shells[0].mesh;
    mesh.normals.assign(mesh.vertices.size(), Vec3::UnitZ());
    hold(
        model,
        [](const Vec3& p) {
          return std::min({p.x(), p.y(), 10 - p.x(), 10 - p.y()}) < eps;
        },
        "xyz", "xyz");
    model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
    return model;
  };
  const auto solved = [](const System& system) { return last_state(system.model(), at_rest()); };
  const System fine(plate(80), at_rest());
  const double truth = ElementFieldEvaluator(fine)(solved(fine)).wall.stress_p99;
  std::vector<double> errors;
  for (const std::size_t n : {10, 14, 20}) {
    const Model model = plate(n);
    const System system(model, at_rest());
    const State last = solved(system);
    const ElementFields fields = ElementFieldEvaluator(system)(last);
    const Estimates found =
        estimate_by_refinement(model, last, fields, {nullptr}, at_rest(), [&](std::vector<ShellBody> bodies) {
          Model finer = model;
          finer.shells = std::move(bodies);
          return finer;
        }).estimates;
    errors.push_back(std::abs(fields.wall.stress_p99 / truth - 1));
    EXPECT_LT(errors.back(), found.at("stress_p99_mpa").error) << n;
    EXPECT_LT(found.at("stress_p99_mpa").error, 2 * errors.back()) << n;
  }
  const double order = std::log2(errors.front() / errors.back());
  EXPECT_GT(order, 1);
  EXPECT_LT(order, 1.6);
}

TEST(Levels, ARigidMotionStaysOne) {
  const ShellBody body = benchmarks::pressurised_sphere(1, thickness, 1).shells.front();
  const std::vector<ShellBody> coarse{body, body};
  const Target target(flat_facets(benchmarks::make_sphere(radius, 4)));
  const Eigen::Quaterniond turn = exponential(Vec3(0.3, -1.1, 0.7));
  const auto moved = [&](const Vec3& x) { return Vec3(turn * x + Vec3(5, 6, 7) - x); };
  State state;
  for (int copy = 0; copy < 2; ++copy) {
    for (const Vec3& x : body.mesh.vertices) {
      state.displacement.push_back(moved(x));
      state.rotation.push_back(logarithm(turn));
    }
  }
  const Level fine = finer_level(coarse, {nullptr, &target});
  ASSERT_EQ(fine.shell_count(), 8 * body.mesh.triangles.size());
  const Checkpoint finer = interpolated(state, coarse, fine);
  std::size_t v = 0;
  State after;
  for (const ShellBody& of : fine.bodies) {
    for (const Vec3& x : of.mesh.vertices) {
      ASSERT_LT(v, finer.displacement.size());
      EXPECT_LT((finer.displacement[v] - moved(x)).norm(), 1e-12 * radius);
      EXPECT_LT(finer.rotation[v].angularDistance(turn), 1e-12);
      after.displacement.push_back(moved(x));
      ++v;
    }
  }
  EXPECT_EQ(v, finer.displacement.size());
  // The nodes of the coarser level move a little in the refit, and with them what moves them.
  EXPECT_LT(field_change(state, after, fine), 0.05);
}

TEST(Levels, ThicknessPerVertexIsInterpolated) {
  ShellBody body = benchmarks::pressurised_sphere(1, thickness, 1).shells.front();
  body.thickness.clear();
  for (const Vec3& x : body.mesh.vertices) {
    body.thickness.push_back(1 + 0.01 * x.z());
  }
  const Level fine = finer_level({body}, {nullptr});
  const auto& got = fine.bodies.front().thickness;
  ASSERT_EQ(got.size(), fine.bodies.front().mesh.vertices.size());
  for (std::size_t i = 0; i < fine.parents.front().size(); ++i) {
    const auto [a, b] = fine.parents.front()[i];
    EXPECT_DOUBLE_EQ(got[body.mesh.vertices.size() + i], (body.thickness[a] + body.thickness[b]) / 2);
  }
}

TEST(Levels, TheFieldTellsWhatTheLargestDoesNot) {
  ShellBody coarse_body, fine_body;
  coarse_body.mesh.vertices.resize(2);
  fine_body.mesh.vertices.resize(3);
  State coarse, fine;
  coarse.displacement = {Vec3(1, 0, 0), Vec3(0, 0, 0)};
  fine.displacement = {Vec3(1, 0, 0), Vec3(0, 0.5, 0), Vec3(0, 0, 0)};
  EXPECT_DOUBLE_EQ(field_change(coarse, fine, {{fine_body}, {{{0, 1}}}}), 0.5);
}

TEST(Levels, PointLoadsAndJumpsOfTheThicknessBendTheWall) {
  Model model = benchmarks::pressurised_sphere(1, thickness, 1);
  EXPECT_EQ(edges_per_layer(model), infinity);
  Model loaded = model;
  Load load;
  load.kind = ForceLoad{{0}, Vec3(0, 0, 1)};
  loaded.loads.push_back(load);
  EXPECT_LT(edges_per_layer(loaded), 2);
  ShellBody& body = model.shells.front();
  body.thickness.assign(body.mesh.vertices.size(), thickness);
  EXPECT_EQ(edges_per_layer(model), infinity);
  body.thickness[0] = 2 * thickness;
  EXPECT_LT(edges_per_layer(model), 2);
}

TEST(Levels, WhatIsSelectedStaysSelected) {
  // A rim of five nodes with a corner at the second one, whose shell has two edges on the rim.
  Model coarse;
  ShellBody body;
  body.mesh.vertices = {Vec3(0, 0, 0), Vec3(1, -1, 0), Vec3(2, 0, 0), Vec3(3, 0, 0), Vec3(2, 2, 0), Vec3(0, 2, 0)};
  body.mesh.triangles = {{0, 1, 2}, {0, 2, 5}, {2, 4, 5}, {2, 3, 4}};
  body.mesh.normals.assign(6, Vec3(0, 0, 1));
  body.mesh.patch = Patch::watertight;
  coarse.shells = {body};
  Fix rim, single;
  rim.nodes = {0, 1, 2, 3};
  single.nodes = {5};
  coarse.fixes = {rim, single};
  Load edge;
  edge.kind = EdgeLoad{{{2, 3}, {0, 1}}, Vec3(0, 0, 1), {1, 0.4}};
  coarse.loads = {edge};
  const Level level = finer_level(coarse.shells, {nullptr});
  Model fine = coarse;
  fine.shells = level.bodies;
  fine.fixes[0].nodes = {0};  // what the place finds of the rim after a refit has moved it
  fine.fixes[1].nodes = {4};
  const auto halved = [&](Index a, Index b) {
    const auto& parents = level.parents.front();
    const auto found = std::find_if(parents.begin(), parents.end(), [&](const auto& pair) {
      return std::minmax(pair[0], pair[1]) == std::minmax(a, b);
    });
    return static_cast<Index>(6 + (found - parents.begin()));
  };
  // Of an edge that a region cuts, its place on the finer level decides.
  // What is no edge there any more is dropped.
  std::get<EdgeLoad>(fine.loads[0].kind) = {{{0, halved(0, 1)}, {2, 3}}, Vec3(0, 0, 1), {0.8, 1}};
  carry_selections(coarse, level, fine);
  EXPECT_THAT(fine.fixes[0].nodes,
              ::testing::UnorderedElementsAre(0, 1, 2, 3, halved(0, 1), halved(1, 2), halved(2, 3)));
  EXPECT_THAT(fine.fixes[1].nodes, ::testing::ElementsAre(4));
  const Index middle = halved(2, 3);
  const std::vector<std::array<Index, 2>> halves{{0, halved(0, 1)}, {2, middle}, {middle, 3}};
  EXPECT_EQ(std::get<EdgeLoad>(fine.loads[0].kind).edges, halves);
  EXPECT_THAT(std::get<EdgeLoad>(fine.loads[0].kind).shares, ::testing::ElementsAre(0.8, 1, 1));
}

/// A sphere under a pressure that grows over `ramp` seconds; it breathes with a period that is known.
struct Breathing : Sphere {
  static constexpr double density = 1e-9;

  explicit Breathing(double periods_of_ramp, double periods_of_run, double steps_per_period) {
    // Source: a thin closed shell's breathing mode, omega^2 = 2 E / (rho R^2 (1 - nu)).
    const double omega = std::sqrt(2 * young / (density * radius * radius * (1 - poisson)));
    const double period = 2 * std::numbers::pi / omega;
    model.shells.front().material.density = density;
    model.loads.front().ramp.points = {{0, 0}, {periods_of_ramp * period, 1}};
    DynamicRun motion;
    motion.duration = periods_of_run * period;
    motion.step = period / steps_per_period;
    motion.integrator = Integrator::generalised_alpha;
    motion.spectral_radius = 1;
    settings.kind = motion;
    // After a ramp of length T the rest oscillates by |sin(pi T / T1)| / (pi T / T1) of the answer at rest.
    const double x = std::numbers::pi * periods_of_ramp;
    peak = exact(Quantity::displacement) * (1 + std::abs(std::sin(x)) / x);
  }
  double peak = 0;
};

TEST(Accuracy, ALongRampIsTakenAsRest) {
  const Breathing slow(20.5, 21, 8);
  const Accuracy found = slow.solved({0.1});
  ASSERT_TRUE(found.reasons.empty()) << found.reasons.front();
  EXPECT_TRUE(std::holds_alternative<StaticRun>(found.settings.kind));
  EXPECT_LT(std::abs(found.levels.back().value / slow.peak - 1), *found.estimate);
  const auto& choice = found.choices.at(2);
  EXPECT_EQ(choice.chosen, "static");
  EXPECT_NEAR(*choice.error, 1 / (std::numbers::pi * 20.5), 0.01);
}

TEST(Accuracy, AShortRampKeepsTheMotionAndItsStepIsHalved) {
  const Breathing fast(1.5, 3, 4);
  const Accuracy found = fast.solved({0.1});
  ASSERT_TRUE(found.reasons.empty()) << found.reasons.front();
  const auto* motion = std::get_if<DynamicRun>(&found.settings.kind);
  ASSERT_NE(motion, nullptr);
  EXPECT_LT(motion->step, 0.6 * std::get<DynamicRun>(fast.settings.kind).step);
  EXPECT_LT(std::abs(found.levels.back().value / fast.peak - 1), *found.estimate);
  EXPECT_EQ(found.choices.back().chosen, "dynamic");
  EXPECT_EQ(found.choices.back().instead, "static");
  EXPECT_GT(found.states.size(), 10U);
}

TEST(Accuracy, AStepThatDoesNotConvergeIsSaid) {
  Breathing fast(1.5, 400, 0.01);  // 100 periods a step: eight halvings do not get to one
  const Accuracy found = fast.solved({0.01});
  ASSERT_FALSE(found.reasons.empty());
  EXPECT_THAT(found.reasons.front(), ::testing::HasSubstr("time step"));
  EXPECT_EQ(found.levels.size(), 1U);
}

}  // namespace
}  // namespace tunica
