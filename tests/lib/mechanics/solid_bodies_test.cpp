// Bodies of tetrahedra against analytic and published solutions.

#include "tets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/mechanics/model/selection.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/mechanics/solids/solid_element.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

struct Bent {
  double deflection = 0;  ///< over Timoshenko's
  double error = 0;       ///< ElementFields::solid_error
};

/// Tip deflection of a cantilever of square section, length 6; Poisson's ratio 0.3, n cells through the thickness.
Bent bent(std::size_t n, SolidLaw law, bool linear) {
  constexpr double length = 6, side = 1, young = 1000, poisson = 0.3, load = 0.01;
  Model model =
      one_solid(make_block(6 * n, n, n, [](const Vec3& u) { return Vec3(u.x() * length, u.y() * side, u.z() * side); }),
                young, poisson, law);
  const auto clamped = [](const Vec3& x) { return x.x() < eps; };
  const auto tip = [](const Vec3& x) { return x.x() > length - eps; };
  // Free to contract at its root, as beam theory wants it.
  hold_nodes(model, 0, clamped, "x");
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.x() < eps && std::abs(x.z() - side / 2) < eps; }, "z");
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.x() < eps && std::abs(x.y() - side / 2) < eps; }, "y");
  const std::vector<Index> nodes = nodes_of(model, 0, tip);
  // Spread over the end as shear is: by the nodes' shares of its area, near enough by Saint-Venant.
  for (const Index i : nodes) {
    const Vec3& x = model.solids[0].mesh.vertices[i];
    const auto share = [&](double at) { return (at < eps || at > side - eps ? 0.5 : 1) / static_cast<double>(n); };
    model.loads.push_back({0, ForceLoad{{i}, Vec3(0, 0, load * share(x.y()) * share(x.z()))}, {}});
  }
  const State state = last_state(model, linear ? linear_run() : nonlinear_run({1}));
  double mean = 0;
  for (const Index i : nodes) {
    mean += state.displacement[i].z() / static_cast<double>(nodes.size());
  }
  const double inertia = side * side * side * side / 12, shear = young / (2 * (1 + poisson));
  const double bending = load * length * length * length / (3 * young * inertia);
  return {mean / (bending + load * length / (shear * side * side * 5 / 6)),
          element_fields(model, state).solid_error.at(0)};
}

double cantilever(std::size_t n, SolidLaw law, bool linear) { return bent(n, law, linear).deflection; }

/// A unit cube, E = 1 MPa, Poisson's ratio 0, pulled along x by so much, all of it by the same.
Model pulled_cube(SolidLaw law, double by) {
  Model model = one_solid(make_block(2, 2, 2, [](const Vec3& u) { return u; }), 1, 0, law);
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.x() < eps; }, "x");
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.y() < eps; }, "y");
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.z() < eps; }, "z");
  move_nodes(
      model, 0, [](const Vec3& x) { return x.x() > 1 - eps; }, [&](const Vec3&) { return Vec3(by, 0, 0); });
  return model;
}

/// At twice the length Green's strain is (4 - 1) / 2.
TEST(SolidBody, SaysHowFarItIsStrainedBeyondItsLaw) {
  for (const SolidLaw law : {SolidLaw::corotational, SolidLaw::neo_hookean}) {
    const Model model = pulled_cube(law, 1);
    const double strain =
        element_fields(model, last_state(model, nonlinear_run({0.25, 0.5, 0.75, 1}))).solid_strain_p99;
    EXPECT_NEAR(strain, law == SolidLaw::corotational ? 1.5 : 0, 0.1);
  }
}

TEST(SolidCantilever, ConvergesToBeamTheory) {
  std::vector<double> errors;
  for (const std::size_t n : {2, 4, 8}) {
    errors.push_back(std::abs(cantilever(n, SolidLaw::corotational, true) - 1));
  }
  EXPECT_LT(errors[1], errors[0] / 2.5);
  EXPECT_LT(errors[2], errors[1] / 3);
  EXPECT_LT(errors[2], 0.05);
}

/// What bends by too little says by how much, to a factor of two.
TEST(SolidCantilever, ItsErrorIsEstimatedByTheJumpsOfStress) {
  for (const std::size_t n : {2, 4, 8}) {
    for (const bool linear : {true, false}) {
      const Bent beam = bent(n, SolidLaw::corotational, linear);
      EXPECT_GT(1 - beam.deflection, 0.8 * beam.error) << n;
      EXPECT_LT(1 - beam.deflection, 2.05 * beam.error) << n;
    }
  }
}

/// A stress that is the same everywhere does not jump.
TEST(SolidBody, AConstantStressHasNoError) {
  const Model model = pulled_cube(SolidLaw::neo_hookean, 0.3);
  const ElementFields fields = element_fields(model, last_state(model, nonlinear_run({1})));
  EXPECT_LT(fields.solid_error.at(0), 1e-12);
  EXPECT_THAT(doubts_of_solids(model, fields.solid_error, {}), ::testing::IsEmpty());
  const std::vector<Warning> coarse = doubts_of_solids(model, {0.3}, {});
  ASSERT_EQ(coarse.size(), 1U);
  EXPECT_THAT(coarse[0].text, ::testing::HasSubstr("30 to 66 % too little"));
  EXPECT_THROW(doubts_of_solids(model, {}, {}), InputError);
}

/// Deflections of less than 1 % of the length: all laws say the same.
TEST(SolidCantilever, AllLawsAgreeAtSmallDeflections) {
  const double linear = cantilever(2, SolidLaw::corotational, true);
  EXPECT_NEAR(cantilever(2, SolidLaw::corotational, false) / linear, 1, 1e-3);
  EXPECT_NEAR(cantilever(2, SolidLaw::neo_hookean, false) / linear, 1, 2e-3);
}

struct SphereError {
  double inside = 0, outside = 0;  ///< relative
};

/// An octant of a sphere, 10 to 20 mm, 60 kPa, under 1 kPa inside: n cells along an edge and through the wall.
SphereError thick_sphere(std::size_t n, double poisson) {
  std::vector<Vec3> directions;
  std::vector<std::array<Index, 3>> triangles;
  const auto node = [&](std::size_t i, std::size_t j) { return static_cast<Index>(i * (2 * n + 3 - i) / 2 + j); };
  for (std::size_t i = 0; i <= n; ++i) {
    for (std::size_t j = 0; i + j <= n; ++j) {
      directions.push_back(
          Vec3(static_cast<double>(n - i - j), static_cast<double>(i), static_cast<double>(j)).normalized());
      if (i + j < n) {
        triangles.push_back({node(i, j), node(i + 1, j), node(i, j + 1)});
      }
      if (i + j + 1 < n) {
        triangles.push_back({node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)});
      }
    }
  }
  constexpr double young = 0.06, pressure = 0.001, inner = 10, outer = 20;
  Model model =
      one_solid(extrude(triangles, directions.size(), n,
                        [&](Index v, double w) { return Vec3((inner + (outer - inner) * w) * directions[v]); }),
                young, poisson);
  for (int c = 0; c < 3; ++c) {
    hold_nodes(
        model, 0, [&](const Vec3& x) { return x[c] < eps; }, std::string(1, "xyz"[c]));
  }
  std::vector<Vec3> forces(directions.size(), Vec3::Zero());
  const auto& x = model.solids[0].mesh.vertices;
  for (const auto& t : triangles) {
    const Vec3 area = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]) / 2;
    for (const Index v : t) {
      forces[v] += (area.dot(directions[v]) > 0 ? 1 : -1) * pressure / 3 * area;
    }
  }
  for (std::size_t v = 0; v < forces.size(); ++v) {
    model.loads.push_back({0, ForceLoad{{static_cast<Index>(v)}, forces[v]}, {}});
  }
  const State state = last_state(model, linear_run());
  const double i3 = inner * inner * inner, o3 = outer * outer * outer;
  const auto exact = [&](double r) {
    return pressure * i3 / (young * (o3 - i3)) * ((1 - 2 * poisson) * r + (1 + poisson) * o3 / (2 * r * r));
  };
  SphereError error;
  const auto count = static_cast<double>(directions.size());
  for (std::size_t v = 0; v < directions.size(); ++v) {
    error.inside += (state.displacement[v].dot(directions[v]) / exact(inner) - 1) / count;
    error.outside += (state.displacement[n * directions.size() + v].dot(directions[v]) / exact(outer) - 1) / count;
  }
  return error;
}

class ThickSphere : public testing::TestWithParam<double> {};

TEST_P(ThickSphere, ConvergesWithTheSquareOfTheMeshWhateverTheCompressibility) {
  const SphereError coarse = thick_sphere(4, GetParam()), fine = thick_sphere(8, GetParam());
  EXPECT_LT(std::abs(fine.inside), std::abs(coarse.inside) / 3);
  EXPECT_LT(std::abs(fine.outside), std::abs(coarse.outside) / 3);
  EXPECT_LT(std::abs(fine.inside), 0.035);
  EXPECT_LT(std::abs(fine.outside), 0.035);
}
INSTANTIATE_TEST_SUITE_P(, ThickSphere, testing::Values(0.3, 0.45, 0.4999));

/// Tip deflection of Cook's membrane in plane strain, n x n cells in one layer.
double cook(std::size_t n, double poisson, Diagonals diagonals) {
  const Grid grid = make_grid(
      n, n, [](double u, double v) { return Vec3(48 * u, 44 * u + v * (44 - 28 * u), 0); }, diagonals);
  const double layer = 48.0 / static_cast<double>(n);
  const std::size_t count = grid.mesh.vertices.size();
  Model model =
      one_solid(extrude(grid.mesh.triangles, count, 1,
                        [&](Index v, double w) { return Vec3(grid.mesh.vertices[v] + Vec3(0, 0, layer * w)); }),
                1, poisson);
  hold_nodes(
      model, 0, [](const Vec3&) { return true; }, "z");
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.x() < eps; }, "xy");
  for (std::size_t j = 0; j <= n; ++j) {  // 1 N per mm of thickness
    const double share = layer * (j == 0 || j == n ? 0.5 : 1) / static_cast<double>(n);
    const Index lower = grid.node(n, j);
    model.loads.push_back({0, ForceLoad{{lower, static_cast<Index>(lower + count)}, Vec3(0, share, 0)}, {}});
  }
  const State state = last_state(model, linear_run());
  return (state.displacement[grid.node(n, n)].y() + state.displacement[grid.node(n, n) + count].y()) / 2;
}

/// Constant strain without a pressure of its own loses 70 %.
TEST(SolidCook, DoesNotLockWhereTheMaterialIsNearlyIncompressible) {
  const double coarse = cook(16, 0.4999, Diagonals::alternating) / 19.42 - 1;
  const double fine = cook(32, 0.4999, Diagonals::alternating) / 19.42 - 1;
  EXPECT_LT(std::abs(coarse), 0.08);
  EXPECT_LT(std::abs(fine), 0.04);
  EXPECT_LT(std::abs(fine), std::abs(coarse));
}

TEST(SolidCook, OfACompressibleMaterial) {
  const double fine = cook(32, 1.0 / 3, Diagonals::alternating) / 22.60 - 1;
  EXPECT_LT(std::abs(fine), 0.03);
}

/// A cube under pressure from all sides, held by three planes: its volume shrinks by p / K.
double shrinks(bool linear, SolidLaw law) {
  constexpr double young = 1, poisson = 0.3, pressure = 1e-5;
  Model model =
      one_solid(make_block(2, 2, 2, [](const Vec3& u) { return Vec3(u - Vec3::Constant(0.5)); }), young, poisson, law);
  for (int c = 0; c < 3; ++c) {
    hold_nodes(
        model, 0, [&](const Vec3& x) { return std::abs(x[c]) < eps; }, std::string(1, "xyz"[c]));
  }
  model.loads.push_back({0, PressureLoad{-pressure, true}, {}});
  const State state = last_state(model, linear ? linear_run() : nonlinear_run({1}));
  const Vec3 change = state.displacement.back() - state.displacement.front();
  const double bulk = young / (3 * (1 - 2 * poisson));
  return change.sum() / (-pressure / bulk);
}

TEST(SolidPressure, PushesOnEverySideOfABody) {
  for (const SolidLaw law : {SolidLaw::corotational, SolidLaw::neo_hookean}) {
    EXPECT_NEAR(shrinks(true, law), 1, 1e-10);
    EXPECT_NEAR(shrinks(false, law), 1, 1e-4);
  }
}

/// A quarter of a tube between planes of symmetry.
Model quarter_of_tube(double inner, double thickness, double young, double poisson, SolidLaw law) {
  const Grid grid = make_grid(
      16, 1, [](double u, double v) { return Vec3(pi / 2 * u, v, 0); }, Diagonals::alternating);
  Model model = one_solid(extrude(grid.mesh.triangles, grid.mesh.vertices.size(), 6,
                                  [&](Index v, double w) {
                                    const Vec3& at = grid.mesh.vertices[v];
                                    const double r = inner + w * thickness;
                                    return Vec3(r * std::cos(at.x()), r * std::sin(at.x()), at.y());
                                  }),
                          young, poisson, law);
  for (int c = 0; c < 3; ++c) {
    hold_nodes(
        model, 0, [&](const Vec3& x) { return x[c] < eps || (c == 2 && x[c] > 1 - eps); }, std::string(1, "xyz"[c]));
  }
  return model;
}

struct TubeOfTetrahedra {
  double hoop = 0;  ///< MPa, mean over the wall
  double inner = 0, outer = 0;
};

/// Of the blown tube.
TubeOfTetrahedra blown(const Model& model, const State& state, double inner, double thickness) {
  const SolidBody& body = model.solids[0];
  TubeOfTetrahedra tube;
  double volume = 0;
  for (const auto& nodes : body.mesh.tetrahedra) {
    Corners4 corners;
    SolidMotion motion;
    for (int k = 0; k < 4; ++k) {
      corners.col(k) = body.mesh.vertices[nodes[k]];
      motion.displacement.col(k) = state.displacement[nodes[k]];
      motion.pressure[k] = state.pressure[nodes[k]];
    }
    const Mat3 stress = solid_stress(make_solid_element(corners, body.material, body.law), motion, false);
    const Corners4 now = corners + motion.displacement;
    const double part =
        std::abs((now.col(1) - now.col(0)).dot((now.col(2) - now.col(0)).cross(now.col(3) - now.col(0)))) / 6;
    const Vec3 out = Vec3(now.row(0).mean(), now.row(1).mean(), 0).normalized();
    const Vec3 around(-out.y(), out.x(), 0);
    const double r = std::hypot(now.row(0).mean(), now.row(1).mean());
    tube.hoop += part / r * around.dot(stress * around);  // per angle
    volume += part / r;
  }
  tube.hoop /= volume;
  const auto radius = [&](double r) {
    const Index node = nodes_of(model, 0, [&](const Vec3& x) {
                         return std::abs(x.x() - r) < eps && x.y() < eps && x.z() < eps;
                       }).front();
    return r + state.displacement[node].x();
  };
  tube.inner = radius(inner);
  tube.outer = radius(inner + thickness);
  return tube;
}

/// Whatever the law, p r / t with the inner radius and the thickness of the blown tube. Shells under the same force per
/// angle bear the same, and are as wide but for what the pressure does through the thickness: nu / (1 - nu) t / (2 r).
TEST(SolidPressure, AThickTubeOfTetrahedraBearsWhatOneOfShellsBears) {
  constexpr double inner = 9, thickness = 2, young = 2, poisson = 0.45, middle = 10, length = 10;
  for (const auto& [law, pressure] :
       {std::pair{SolidLaw::corotational, 0.02}, std::pair{SolidLaw::neo_hookean, 0.02},
        std::pair{SolidLaw::corotational, 0.07}, std::pair{SolidLaw::neo_hookean, 0.05}}) {
    Model solid = quarter_of_tube(inner, thickness, young, poisson, law);
    const std::vector<Index> inside =
        nodes_of(solid, 0, [](const Vec3& x) { return x.head<2>().norm() < inner + eps; });
    Load load{0, PressureLoad{-pressure, true}, {}};
    std::get<PressureLoad>(load.kind).shares = whole_triangles(boundary_triangles(solid.solids[0].mesh), inside);
    solid.loads.push_back(load);
    const TubeOfTetrahedra tube = blown(solid, last_state(solid, nonlinear_run({0.5, 1})), inner, thickness);
    EXPECT_NEAR(tube.hoop, pressure * tube.inner / (tube.outer - tube.inner), 0.005 * tube.hoop);

    Model shells;
    ShellBody body = flat_body(tube_mesh(middle, middle, length, 48, 10), young, poisson, thickness);
    body.curved = true;
    body.rest = Rest::curved;
    shells.shells.push_back(body);
    hold(
        shells, [](const Vec3& p) { return p.z() < eps || p.z() > length - eps; }, "z", "xy");
    shells.rigid_motions.push_back({0});
    const double now = (tube.inner + tube.outer) / 2;
    shells.loads.push_back({0, PressureLoad{pressure * tube.inner / now, true}, {}});
    const State state = last_state(shells, nonlinear_run({0.5, 1}));
    const double wide = (shells.shells[0].mesh.vertices[240] + state.displacement[240]).head<2>().norm();
    const Wall wall = element_fields(shells, state).wall;
    const double strain = now / middle - 1;
    EXPECT_NEAR(wide / now, 1, 0.1 * strain + strain * strain);
    EXPECT_NEAR(wall.whole.tension_p99, tube.hoop * (tube.outer - tube.inner) * wide / now,
                0.005 * tube.hoop * thickness);
  }
}

TEST(SolidPressure, RigidMotionsOfASolidAreRefused) {
  Model model = one_solid(make_block(2, 2, 2, [](const Vec3& u) { return u; }), 1, 0.3);
  model.rigid_motions.push_back({0});
  EXPECT_THAT(error_of(model, linear_run()),
              testing::HasSubstr("solid: a solid cannot be held by its rigid motions yet"));
}

TEST(SolidBody, WhatSolidsCannotDoIsRefused) {
  Model model = one_solid(make_block(2, 2, 2, [](const Vec3& u) { return u; }), 1, 0.3);
  model.solids[0].material.density = 1e-9;
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.z() < eps; }, "xyz");
  RunSettings by_cg = nonlinear_run({1});
  by_cg.solver = Solver::cg;
  EXPECT_THAT(error_of(model, by_cg), testing::HasSubstr("use solver = \"direct\""));
  RunSettings damped;
  damped.kind = DynamicRun{.duration = 1, .step = 0.1, .damping = {0, 0.1}};
  EXPECT_THAT(error_of(model, damped), testing::HasSubstr("damping by stiffness does not reach solids"));
  RunSettings modes;
  modes.kind = FrequencyRun{};
  EXPECT_THAT(error_of(model, modes), testing::HasSubstr("not available yet"));
  model.solids[0].material.poisson = 0.49995;
  EXPECT_THAT(error_of(model, nonlinear_run({1})), testing::HasSubstr("at most 0.4999"));
}

/// A bar that can only move along its axis, its sides free to contract.
Model bar(double length, double young, double density) {
  Model model = one_solid(
      make_block(2, 2, 10, [&](const Vec3& u) { return Vec3(u.x() - 0.5, u.y() - 0.5, u.z() * length); }), young, 0.3);
  model.solids[0].material.density = density;
  for (int c = 0; c < 2; ++c) {
    hold_nodes(
        model, 0, [&](const Vec3& x) { return std::abs(x[c]) < eps; }, std::string(1, "xyz"[c]));
  }
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.z() < eps; }, "z");
  return model;
}

/// A force put on at once stretches a bar by twice what it does at rest, half a period later.
TEST(SolidDynamics, ASuddenForceStretchesABarTwice) {
  constexpr double length = 10, young = 1000, density = 1e-9, force = 1;
  Model model = bar(length, young, density);
  const std::vector<Index> tip = nodes_of(model, 0, [](const Vec3& x) { return x.z() > length - eps; });
  model.loads.push_back({0, ForceLoad{tip, Vec3(0, 0, force)}, Ramp{{{0, 1}}}});
  const double period = 4 * length / std::sqrt(young / density);
  DynamicRun run;
  run.duration = period;
  run.step = period / 100;
  run.integrator = Integrator::generalised_alpha;
  RunSettings settings;
  settings.kind = run;
  double largest = 0, when = 0;
  const Summary summary = solve(model, settings, [&](const State& state) {
    double mean = 0;
    for (const Index i : tip) {
      mean += state.displacement[i].z() / static_cast<double>(tip.size());
    }
    if (mean > largest) {
      largest = mean;
      when = state.time;
    }
  });
  EXPECT_NEAR(largest / (2 * force * length / young), 1, 0.04);
  EXPECT_NEAR(when / (period / 2), 1, 0.06);
  ASSERT_TRUE(summary.energy);
  EXPECT_LT(std::abs(summary.energy->lost), 0.05 * summary.energy->largest);
}

/// A column that is bent far: the path by arc length ends where load control does.
TEST(SolidArcLength, EndsWhereLoadControlDoes) {
  Model model = one_solid(make_block(2, 2, 8, [](const Vec3& u) { return Vec3(u.x() - 0.5, u.y() - 0.5, 8 * u.z()); }),
                          1, 0.3, SolidLaw::neo_hookean);
  hold_nodes(
      model, 0, [](const Vec3& x) { return x.z() < eps; }, "xyz");
  const std::vector<Index> tip = nodes_of(model, 0, [](const Vec3& x) { return x.z() > 8 - eps; });
  model.loads.push_back({0, ForceLoad{tip, Vec3(0.02, 0, 0)}, {}});
  ArcLengthRun run;
  run.max_factor = 1;
  RunSettings settings;
  settings.kind = run;
  const State path = last_state(model, settings), steps = last_state(model, nonlinear_run({0.5, 1}));
  ASSERT_NEAR(path.load_factor, 1, 1e-9);
  EXPECT_GT(steps.displacement[tip[0]].x(), 5);
  EXPECT_NEAR(path.displacement[tip[0]].x(), steps.displacement[tip[0]].x(), 1e-6);
}

}  // namespace
}  // namespace tunica
