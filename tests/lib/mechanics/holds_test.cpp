// What holds an organ beside fixed nodes: rims that slide in their planes, and elastic beds.

#include "benchmarks.hpp"
#include "tunica/mechanics/model/selection.hpp"
#include "tunica/mechanics/runs/detail/run.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/runs/hold_doubts.hpp"

#include <Eigen/Dense>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica::holds {
namespace {

using namespace benchmarks;

constexpr double radius = 10, young = 2, poisson = 0.45, thickness = 0.5, pressure = 2e-3;

Vec3 tilted(const Vec3& p) { return Eigen::AngleAxisd(0.7, Vec3(1, 2, -0.5).normalized()) * p + Vec3(3, -4, 5); }
Vec3 tilted_axis() { return tilted(Vec3::UnitZ()) - tilted(Vec3::Zero()); }

/// A tube along a tilted axis, its rims free.
Model tube(double length, std::size_t around, std::size_t along) {
  ShellMesh mesh = tube_mesh(radius, radius, length, around, along);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.vertices[i] = tilted(mesh.vertices[i]);
    mesh.normals[i] = tilted(mesh.normals[i]) - tilted(Vec3::Zero());
  }
  Model model;
  ShellBody body = flat_body(std::move(mesh), young, poisson, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  body.material.density = 1.1e-9;
  model.shells.push_back(body);
  model.loads.push_back({0, PressureLoad{pressure, true}, {}});
  return model;
}

std::vector<Index> ring(std::size_t j, std::size_t around) {
  std::vector<Index> nodes;
  for (std::size_t i = 0; i < around; ++i) {
    nodes.push_back(static_cast<Index>(j * around + i));
  }
  return nodes;
}

/// Both rims slide, and what that leaves is held without stress.
Model sliding_tube(double length, std::size_t around, std::size_t along) {
  Model model = tube(length, around, along);
  for (const std::size_t j : {std::size_t{0}, along}) {
    Fix slide;
    slide.nodes = ring(j, around);
    slide.across = tilted_axis();
    model.fixes.push_back(slide);
  }
  model.rigid_motions.push_back({0});
  return model;
}

void add_bed(Model& model, double stiffness, bool normal_only) {
  Support support;
  support.stiffness = stiffness;
  support.normal_only = normal_only;
  model.supports.push_back(support);
}

/// How far a node moves away from the tube's axis.
double widening(const Model& model, const State& state, std::size_t node) {
  const Vec3 arm = model.shells[0].mesh.vertices[node] - tilted(Vec3::Zero());
  const Vec3 out = (arm - arm.dot(tilted_axis()) * tilted_axis()).normalized();
  return state.displacement[node].dot(out);
}

/// Plane strain: hoop p R / t, u = p R^2 (1 - nu^2) / (E t), the same at the rims as in the middle.
TEST(Slide, TubeIsStressedEvenlyUpToItsRims) {
  const Model model = sliding_tube(30, 48, 24);
  const State state = last_state(model, linear_run());
  const double wanted = pressure * radius * radius * (1 - poisson * poisson) / (young * thickness);
  for (const std::size_t node : {std::size_t{0}, std::size_t{5}, std::size_t{600}, model.node_count() - 7}) {
    EXPECT_NEAR(widening(model, state, node), wanted, 0.005 * wanted);
    EXPECT_NEAR(state.displacement[node].dot(tilted_axis()), 0, 1e-3 * wanted);
  }
  const ElementFields fields = element_fields(model, state);
  const double hoop = pressure * radius / thickness;
  const double expected = hoop * std::sqrt(1 - poisson + poisson * poisson);
  const auto [least, most] = std::ranges::minmax(fields.von_mises);
  EXPECT_NEAR(least, expected, 0.01 * expected);
  EXPECT_LT(most - least, 0.005 * most);
}

// Cut at an angle, the tube lacks what would pull in the rims' planes: membrane stress is too large by once to twice
// that angle.
TEST(Slide, SlantingRimsAreOffByOnceToTwiceTheirSlant) {
  for (const auto& [slope, wall_thickness, least, most] :
       {std::array{0.09, 0.5, 1.0, 2.0}, {0.18, 0.5, 1.0, 2.0}, {0.09, 3.0, 0.7, 1.0}, {0.09, 0.1, 1.5, 2.2}}) {
    const double exact = pressure * radius / wall_thickness * std::sqrt(0.75);
    Model model = sliding_tube(60, 32, 48);
    model.shells[0].thickness = {wall_thickness};
    const Vec3 sideways = tilted(Vec3::UnitX()) - tilted(Vec3::Zero());
    for (Vec3& x : model.shells[0].mesh.vertices) {
      x += slope * (x - tilted(Vec3::Zero())).dot(sideways) * tilted_axis();
    }
    for (Fix& fix : model.fixes) {
      fix.across = (tilted_axis() - slope * sideways).normalized();
      EXPECT_NEAR(slant_of_rim(model.shells[0], fix), slope, 0.05 * slope);
    }
    std::get<PressureLoad>(model.loads[0].kind).imaged_at = pressure;
    const System system(model, nonlinear_run({1}));
    State state;
    solve(system, [&](const State& now) { state = now; });
    const Wall wall = ElementFieldEvaluator(system)(state).wall;
    EXPECT_GT(wall.whole.membrane_p99 / exact - 1, least * slope);
    EXPECT_LT(wall.whole.membrane_p99 / exact - 1, most * slope);
    EXPECT_GT(wall.left_out, 0);
    const std::vector<Warning> found = doubts_of_ends(model);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, "slanting rim");
  }
  const Model upright_tube = sliding_tube(60, 32, 48);
  EXPECT_LT(slant_of_rim(upright_tube.shells[0], upright_tube.fixes[0]), 1e-6);
  EXPECT_TRUE(doubts_of_ends(upright_tube).empty());
}

/// A flat strip with the normals of its plane, whose ends are pulled apart by their translations.
struct PulledStrip {
  static constexpr double length = 100, modulus = 1000, density = 1e-9;
  double thickness = 0.5, strain = 0.01;
  Membrane membrane = Membrane::adapt;
  const char* held_rotations = "";

  [[nodiscard]] Model model() const {
    Model model;
    const auto place = [](double u, double v) { return Vec3(length * u, 20 * v, 0); };
    ShellBody body = flat_body(make_grid(20, 4, place, Diagonals::random).mesh, modulus, 0, thickness);
    body.mesh.normals.assign(body.mesh.vertices.size(), Vec3::UnitZ());
    body.curved = true;
    body.rest = Rest::curved;
    body.membrane = membrane;
    body.material.density = density;
    model.shells.push_back(std::move(body));
    for (const double end : {0.0, length}) {
      hold(
          model, [end](const Vec3& p) { return std::abs(p.x() - end) < eps; }, "xyz", held_rotations);
    }
    model.fixes.back().displacement = Vec3(strain * length, 0, 0);
    return model;
  }
  /// Hz, of the first mode, relative to a string's, sqrt(stress / density) / (2 L), and what bending adds.
  [[nodiscard]] double relative_frequency() const {
    RunSettings settings;
    settings.kind = FrequencyRun{1, {false, {1}}};
    const Summary summary = solve(model(), settings, [](const State&) {});
    EXPECT_TRUE(summary.snaps.empty());
    const double wave = pi / (length * (1 + strain));
    const double of_tension = modulus * strain / density * wave * wave;
    const double of_bending = modulus * thickness * thickness / 12 / density * std::pow(wave, 4);
    return summary.frequencies[0] / std::sqrt(of_tension + of_bending) * 2 * pi;
  }
};

/// Reactions of translations are in balance with a constant tension, on a grid whose nodes and diagonals are drawn.
TEST(HeldEdges, AStripThatIsPulledIsStressedEvenlyWhateverHoldsItsRotations) {
  for (const Membrane membrane : {Membrane::adapt, Membrane::opt, Membrane::cst}) {
    for (const char* rotations : {"", "z", "xyz"}) {
      for (const RunSettings& settings : {linear_run(), nonlinear_run({1})}) {
        const Model model = PulledStrip{.membrane = membrane, .held_rotations = rotations}.model();
        const ElementFields fields = element_fields(model, last_state(model, settings));
        const auto [least, most] = std::ranges::minmax(fields.von_mises);
        constexpr double wanted = PulledStrip::modulus * 0.01;
        EXPECT_NEAR(least, wanted, 1e-7 * wanted);
        EXPECT_NEAR(most, wanted, 1e-7 * wanted);
      }
    }
  }
}

TEST(HeldEdges, AStripInTensionRingsAsAString) {
  for (const double strain : {1e-5, 1e-3, 1e-2}) {
    for (const char* rotations : {"", "z"}) {
      EXPECT_NEAR((PulledStrip{.strain = strain, .held_rotations = rotations}.relative_frequency()), 1, 0.006)
          << strain;
    }
  }
}

/// By an edge load, in its plane and out of it.
TEST(HeldEdges, AThinStripThatALoadPullsStaysFlat) {
  for (const double thickness : {0.5, 0.02}) {
    for (const bool in_plane : {true, false}) {
      Model model = PulledStrip{.thickness = thickness}.model();
      model.fixes.pop_back();
      const std::vector<Index> end =
          nodes_where(model.shells[0].mesh, [](const Vec3& p) { return p.x() > PulledStrip::length - eps; });
      EdgeLoad pull;
      for (std::size_t i = 0; i + 1 < end.size(); ++i) {
        pull.edges.push_back({end[i], end[i + 1]});
      }
      pull.per_length = Vec3(0.01 * PulledStrip::modulus * thickness, 0, 0);
      model.loads.push_back({0, pull, {}});
      hold(
          model, [&](const Vec3& p) { return in_plane || p.x() > PulledStrip::length - eps; }, "z", "");
      State last;
      const Summary summary = solve(model, nonlinear_run({1}), [&](const State& state) { last = state; });
      EXPECT_TRUE(summary.snaps.empty());
      const ElementFields fields = element_fields(model, last);
      const auto [least, most] = std::ranges::minmax(fields.von_mises);
      EXPECT_NEAR(least, 10, 0.15);  // the load is dead, and the strip gets narrower nowhere
      EXPECT_NEAR(most, 10, 0.15);
    }
  }
}

/// On the last ring of a tube.
EdgeLoad load_on_end(Index around, Index along, const Vec3& per_length) {
  EdgeLoad load;
  for (Index i = 0; i < around; ++i) {
    load.edges.push_back({along * around + i, along * around + (i + 1) % around});
  }
  load.per_length = per_length;
  return load;
}

/// The load acts on the arcs of its rim, as the wall does: the rim narrows by Poisson's ratio and stays round.
TEST(HeldEdges, ATubeThatALoadPullsStaysRoundHoweverThin) {
  constexpr Index around = 24, along = 16;
  for (const double thickness : {0.1, 0.02, 0.01}) {
    Model model;
    model.shells.push_back(flat_body(tube_mesh(10, 10, 40, around, along), 1000, 0.3, thickness));
    model.shells[0].curved = true;
    model.shells[0].rest = Rest::curved;
    const auto foot = [](const Vec3& p) { return p.z() < eps; };
    hold(model, foot, "z", "xy");
    hold(
        model, [&](const Vec3& p) { return foot(p) && std::abs(p.y()) < eps; }, "y", "");
    hold(
        model, [&](const Vec3& p) { return foot(p) && std::abs(p.x()) < eps; }, "x", "");
    model.loads.push_back({0, load_on_end(around, along, Vec3(0, 0, 10 * thickness)), {}});  // a strain of 1 %
    for (const RunSettings& settings : {linear_run(), nonlinear_run({1})}) {
      State last;
      const Summary summary = solve(model, settings, [&](const State& state) { last = state; });
      EXPECT_TRUE(summary.snaps.empty());
      for (Index i = along * around; i < (along + 1) * around; ++i) {
        const Vec3 place = model.shells[0].mesh.vertices[i] + last.displacement[i];
        EXPECT_NEAR(place.head<2>().norm(), 10 * (1 - 0.3 * 0.01), 2e-4);
        EXPECT_NEAR(last.displacement[i].z(), 0.4, 4e-4);
      }
      const Wall wall = ElementFieldEvaluator(System(model, settings))(last).wall;
      EXPECT_NEAR(wall.membrane_p99, 10, 0.06);
    }
  }
}

TEST(HeldEdges, ALoadOnAnEdgeThatNoElementHasIsRefused) {
  Model model;
  model.shells.push_back(flat_body(tube_mesh(10, 10, 40, 12, 8), 1000, 0.3, 0.1));
  EdgeLoad pull;
  pull.edges.push_back({8 * 12, 8 * 12 + 6});
  pull.per_length = Vec3::UnitZ();
  model.loads.push_back({0, pull, {}});
  EXPECT_THAT(
      [&] { (void)solve(model, linear_run(), [](const State&) {}); },
      ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("an edge from node 96 to 102, which no element has")));
}

/// The reactions of nodes that may turn act at the nodes, the wall's tension on the arcs between them: the moment of
/// one about the other bends the rim, by as much as the arcs rise.
TEST(HeldEdges, ARimThatMayTurnIsBentByItsTensionLessOnFinerMeshes) {
  const auto off = [](Index n) {
    Model model;
    model.shells.push_back(flat_body(tube_mesh(10, 10, 40, n, 2 * n / 3), 1000, 0.3, 0.5));
    model.shells[0].curved = true;
    model.shells[0].rest = Rest::curved;
    const auto foot = [](const Vec3& p) { return p.z() < eps; };
    hold(model, foot, "z", "");
    hold(
        model, [&](const Vec3& p) { return foot(p) && std::abs(p.y()) < eps; }, "y", "");
    hold(
        model, [&](const Vec3& p) { return foot(p) && std::abs(p.x()) < eps; }, "x", "");
    hold(
        model, [](const Vec3& p) { return p.z() > 40 - eps; }, "z", "");
    model.fixes.back().displacement = Vec3(0, 0, 0.04);
    const State state = last_state(model, linear_run());
    const std::size_t end = n * (2 * n / 3);
    return (model.shells[0].mesh.vertices[end] + state.displacement[end]).head<2>().norm() / 10 / (1 - 0.3 * 1e-3) - 1;
  };
  const double coarse = off(24), fine = off(48);
  EXPECT_NEAR(coarse / 1e-3, 0.4, 0.02);  // of the strain
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.1);
}

/// Lateral loads on a free rim: the displacement converges from coarse meshes on.
TEST(HeldEdges, ALoadThatBendsAFreeRimConverges) {
  const auto displacement = [](Index n) {
    Model model;
    model.shells.push_back(flat_body(tube_mesh(10, 10, 40, n, n), 1000, 0.3, 0.5));
    model.shells[0].curved = true;
    model.shells[0].rest = Rest::curved;
    hold(
        model, [](const Vec3& p) { return p.z() < eps; }, "xyz", "xyz");
    model.loads.push_back({0, load_on_end(n, n, Vec3(1e-3, 0, 0)), {}});
    double largest = 0;
    for (const Vec3& u : last_state(model, linear_run()).displacement) {
      largest = std::max(largest, u.norm());
    }
    return largest;
  };
  const double truth = displacement(64);
  EXPECT_NEAR(displacement(16) / truth, 1, 0.012);
  EXPECT_NEAR(displacement(24) / truth, 1, 0.002);
}

/// The energy of tension is that of the patches' surface, which moves between the nodes: their mass does not.
TEST(HeldEdges, AThinStripOfFewShellsRingsTooSlowly) {
  EXPECT_NEAR((PulledStrip{.thickness = 0.02}.relative_frequency()), 0.64, 0.02);
  EXPECT_NEAR((PulledStrip{.thickness = 0.02, .membrane = Membrane::cst}.relative_frequency()), 1, 0.006);
}

/// A bow or a bulge of the edges that are pulled would move them inward: from a strain of 4 (t / h)^2 on it gained.
TEST(HeldEdges, AThinStripThatIsPulledStaysFlat) {
  for (const char* rotations : {"", "z", "x", "xyz"}) {
    const Model model = PulledStrip{.thickness = 0.02, .held_rotations = rotations}.model();
    State last;
    const Summary summary = solve(model, nonlinear_run({1}), [&](const State& state) { last = state; });
    EXPECT_TRUE(summary.converged);
    EXPECT_TRUE(summary.snaps.empty());
    for (const Vec3& u : last.displacement) {
      EXPECT_LT(std::abs(u.z()), 1e-9);
    }
  }
}

TEST(Slide, NodesStayInTheirPlanesInEveryKindOfRun) {
  Model model = sliding_tube(30, 24, 12);
  std::get<PressureLoad>(model.loads[0].kind).value = pressure;
  RunSettings dynamic;
  DynamicRun motion;
  motion.duration = 0.05;
  motion.step = 2.5e-3;
  motion.integrator = Integrator::generalised_alpha;
  dynamic.kind = motion;
  RunSettings path;
  ArcLengthRun arc;
  arc.max_factor = 1;
  path.kind = arc;
  RunSettings by_cg = nonlinear_run({1});
  by_cg.solver = Solver::cg;
  std::vector<double> widened;
  for (const RunSettings& settings : {linear_run(), nonlinear_run({1}), by_cg, dynamic, path}) {
    const State state = last_state(model, settings);
    for (const std::size_t node : {std::size_t{3}, model.node_count() - 3}) {
      EXPECT_LT(std::abs(state.displacement[node].dot(tilted_axis())), 1e-9 * state.displacement[node].norm());
      const Vec3 turn = state.rotation[node];
      EXPECT_LT((turn - turn.dot(tilted_axis()) * tilted_axis()).norm(), 1e-7);
      EXPECT_GT(widening(model, state, node), 0.05);
    }
    widened.push_back(widening(model, state, 3));
    EXPECT_NEAR(widening(model, state, 3), widening(model, state, 15), 1e-4 * widened.back());
  }
  EXPECT_NEAR(widened[1], widened[2], 1e-5 * widened[1]);
  EXPECT_NEAR(widened[1], widened[4], 1e-5 * widened[1]);
}

TEST(Slide, PrestressIsEvenUpToTheRims) {
  Model model = sliding_tube(30, 48, 24);
  std::get<PressureLoad>(model.loads[0].kind).imaged_at = pressure;
  const System system(model, nonlinear_run({1}));
  State state;
  solve(system, [&](const State& now) { state = now; });
  for (const Vec3& u : state.displacement) {
    EXPECT_LT(u.norm(), 1e-8);
  }
  const ElementFields fields = ElementFieldEvaluator(system)(state);
  EXPECT_EQ(fields.wall.left_out, 0);
  const auto [least, most] = std::ranges::minmax(fields.von_mises);
  EXPECT_LT(most - least, 0.005 * most);
}

TEST(Slide, LeavesTheMotionsInItsPlaneFree) {
  Model model = sliding_tube(30, 24, 12);
  model.rigid_motions.clear();
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("3 of its 6 rigid motions are not held"));
  hold(
      model, [&](const Vec3& p) { return (p - model.shells[0].mesh.vertices[0]).norm() < eps; }, "xy", "");
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("another fix holds a part of its freedoms"));
  model.fixes.back().nodes = ring(0, 24);
  model.fixes.back().translation = model.fixes.back().rotation = {true, true, true};
  EXPECT_EQ(error_of(model, linear_run()), "");
}

TEST(Slide, WhatFailsBetweenEndsThatSlideIsToldOfABed) {
  Model model = sliding_tube(30, 24, 12);
  EXPECT_THAT(remedy_of_failure(model, {0.5}), testing::HasSubstr("SUPPORT=1e5N/m3"));
  add_bed(model, 1e-4, false);
  EXPECT_EQ(remedy_of_failure(model, {0.5}), "");
}

/// Each rotation and shift that the planes leave costs nothing; what they hold does.
TEST(Slide, FrequenciesLeaveOutWhatIsFree) {
  Model model = sliding_tube(30, 24, 12);
  model.loads.clear();
  RunSettings settings;
  settings.kind = FrequencyRun{3, {false, {1}}};
  const std::vector<double> frequencies = solve(model, settings, [](const State&) {}).frequencies;
  ASSERT_EQ(frequencies.size(), 3U);
  EXPECT_GT(frequencies[0], 1);
}

/// u = p / (k + 2 E t / ((1 - nu) R^2)).
TEST(Bed, SphereMeetsItsFormula) {
  for (const bool normal_only : {true, false}) {
    for (const double stiffness : {1e-4, 1e-2}) {
      Model model = pressurised_sphere(3, 0.5, 1);
      model.shells[0].material.poisson = 0.3;
      add_bed(model, stiffness, normal_only);
      const double wanted = 1 / (stiffness + 2 * 1000 * 0.5 / (0.7 * 100));
      const State state = last_state(model, linear_run());
      for (std::size_t i = 0; i < model.node_count(); i += 50) {
        const double u = state.displacement[i].dot(model.shells[0].mesh.normals[i]);
        EXPECT_NEAR(u, wanted, 0.005 * wanted) << stiffness;
      }
    }
  }
}

/// u = p / (k + E t / ((1 - nu^2) R^2)), also moved on from a prestressed image, where the bed bears nothing.
TEST(Bed, TubeMeetsItsFormula) {
  constexpr double stiffness = 1e-2;
  Model model = sliding_tube(20, 48, 16);
  add_bed(model, stiffness, false);
  const double wanted = pressure / (stiffness + young * thickness / ((1 - poisson * poisson) * radius * radius));
  EXPECT_NEAR(widening(model, last_state(model, linear_run()), 400), wanted, 0.005 * wanted);
  EXPECT_NEAR(widening(model, last_state(model, nonlinear_run({1})), 400), wanted, 0.03 * wanted);

  std::get<PressureLoad>(model.loads[0].kind).imaged_at = pressure;
  for (const Vec3& u : last_state(model, nonlinear_run({1})).displacement) {
    EXPECT_LT(u.norm(), 1e-8);
  }
  std::get<PressureLoad>(model.loads[0].kind).value = 1.01 * pressure;
  EXPECT_NEAR(widening(model, last_state(model, nonlinear_run({1})), 400), 0.01 * wanted, 0.0005 * wanted);
}

/// On a bed along the normal nothing holds a tube about its axis but its own unevenness: it stays where it is, and
/// widens as on one that holds it in all directions, which a round tube does not notice.
TEST(Bed, AnUnevenTubeDoesNotTurnOutOfABedAlongItsNormals) {
  Model model = sliding_tube(30, 24, 12);
  std::get<PressureLoad>(model.loads[0].kind).value = 5 * pressure;
  ShellMesh& mesh = model.shells[0].mesh;
  for (std::size_t i = 24; i < mesh.vertices.size() - 24; ++i) {
    mesh.vertices[i] += 0.15 * std::sin(37.0 * static_cast<double>(i * i % 101)) * mesh.normals[i];
  }
  std::array<double, 2> widened{};
  for (const bool normal_only : {false, true}) {
    model.supports.clear();
    add_bed(model, 2e-3, normal_only);
    const State state = last_state(model, nonlinear_run({1}));
    double aside = 0;
    for (std::size_t i = 0; i < model.node_count(); ++i) {
      widened[normal_only ? 1 : 0] += widening(model, state, i) / static_cast<double>(model.node_count());
      aside = std::max(aside, state.displacement[i].dot(tilted_axis().cross(mesh.normals[i])));
    }
    EXPECT_LT(aside, 0.5 * widened[normal_only ? 1 : 0]);
  }
  EXPECT_NEAR(widened[1], widened[0], 0.02 * widened[0]);
}

/// A wall that slides by a part of its radius is as far from its bed as before: forces and tangent are those of the
/// distance from a sphere, to second order of the slide.
TEST(Bed, AlongTheNormalItIsTheDistanceThatCounts) {
  Model model = pressurised_sphere(3, 0.5, 1);
  add_bed(model, 1e-2, true);
  const System system(model, nonlinear_run({1}));
  const ShellSystem& parts = system.parts();
  Configuration turned = reference_configuration(parts);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05, Vec3(1, 2, 3).normalized()));
  for (std::size_t i = 0; i < parts.node_count(); ++i) {
    turned.displacement[i] = turn * parts.reference[i] - parts.reference[i];
  }
  Configuration widened = reference_configuration(parts);
  for (std::size_t i = 0; i < parts.node_count(); ++i) {
    widened.displacement[i] = 0.05 * parts.reference[i];
  }
  EXPECT_LT(parts.bed->energy(parts, turned), 1e-4 * parts.bed->energy(parts, widened));
}

/// A beam whose ends stay upright under q cos(pi z / L): w = q / (k + bending and shear in series), k per length.
TEST(Bed, BeamLikeTubeMeetsWinkler) {
  constexpr std::size_t around = 24, along = 80;
  constexpr double length = 250, stiffness = 2e-6, load = 1e-4;
  Model model = sliding_tube(length, around, along);
  model.loads.clear();
  add_bed(model, stiffness, false);
  const Vec3 aside = tilted(Vec3::UnitX()) - tilted(Vec3::Zero());
  const double step = length / along;
  for (std::size_t j = 0; j <= along; ++j) {
    const double share = j == 0 || j == along ? 0.5 : 1;
    ForceLoad force;
    force.nodes = ring(j, around);
    force.total = load * step * share * std::cos(pi * static_cast<double>(j) / along) * aside;
    model.loads.push_back({0, force, {}});
  }
  const double wave = pi / length;
  const double per_length = stiffness * 2 * pi * radius;
  const double bending = young * pi * radius * radius * radius * thickness * std::pow(wave, 4);
  const double shear = young / (2 * (1 + poisson)) * pi * radius * thickness * wave * wave;  // half the area
  const double wanted = load / (per_length + bending * shear / (bending + shear));
  const State state = last_state(model, linear_run());
  Vec3 mean = Vec3::Zero();
  for (const Index i : ring(0, around)) {
    mean += state.displacement[i] / around;
  }
  EXPECT_NEAR(mean.dot(aside), wanted, 0.02 * wanted);
  EXPECT_GT(per_length, 0.2 * bending);  // the bed counts
}

TEST(Bed, HoldsRigidMotionsAndVibrates) {
  constexpr double stiffness = 1e-3, density = 1.1e-9;
  Model model = tube(30, 24, 12);
  model.loads.clear();
  model.loads.push_back({0, AreaLoad{1e-5 * Vec3::UnitX()}, {}});
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("6 of its 6 rigid motions"));
  add_bed(model, stiffness, false);
  const State state = last_state(model, linear_run());
  EXPECT_NEAR(state.displacement[100].x(), 1e-5 / stiffness, 0.01 * 1e-5 / stiffness);
  const State nonlinear = last_state(model, nonlinear_run({1}));
  EXPECT_NEAR(nonlinear.displacement[100].x(), 1e-5 / stiffness, 0.01 * 1e-5 / stiffness);

  model.loads.clear();
  RunSettings settings;
  settings.kind = FrequencyRun{1, {false, {1}}};
  const double wanted = std::sqrt(stiffness / (density * thickness)) / (2 * pi);
  const auto lowest = solve(model, settings, [](const State&) {}).frequencies.front();
  EXPECT_LE(lowest, 1.001 * wanted);
  EXPECT_GT(lowest, 0.98 * wanted);
}

TEST(Bed, IsRefusedWhereItMakesNoSense) {
  Model model = sliding_tube(30, 24, 12);
  add_bed(model, -1, false);
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("stiffness"));
  model.supports[0].stiffness = 1;
  std::vector<double>& shares = model.supports[0].shares;
  shares.assign(model.shells[0].mesh.triangles.size(), 0);
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("no part of a triangle"));
  shares[0] = 1.5;
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("one from 0 to 1 for each"));
  shares = {1};
  EXPECT_THAT(error_of(model, linear_run()), testing::HasSubstr("one from 0 to 1 for each"));
}

/// A part of a plate that is pressed bears that part of the force, in every form of pressure, wherever triangles lie.
TEST(PressureOn, APartOfABody) {
  for (const auto& [follower, part] : {std::pair(true, 0.5), {false, 0.5}, {true, 0.3}, {false, 0.99}}) {
    Grid grid = make_grid(8, 8, [](double u, double v) { return Vec3(u, v, 0); });
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, 0.01));
    PressureLoad load{3, follower};
    load.shares = shares_of(SelectableBody(model.shells[0]), HalfSpaceNodes{0, part, false}, "here");
    model.loads.push_back({0, load, {}});
    const ShellSystem system = make_system(model);
    Forces forces;
    evaluate(system, {reference_configuration(system), {1}}, forces, nullptr);
    double sum = 0;
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      sum += forces.external[first_freedom(i) + 2];
    }
    EXPECT_NEAR(std::abs(sum), 3 * (1 - part), 1e-9);
  }
}

}  // namespace
}  // namespace tunica::holds
