// Natural frequencies and buckling factors against closed forms.

#include "benchmarks.hpp"
#include "tunica/core/error.hpp"
#include "tunica/mechanics/algebra/lanczos.hpp"

#include <Eigen/Dense>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

RunSettings frequency_run(std::size_t count) {
  RunSettings settings;
  settings.kind = FrequencyRun{count, {false, {1}}};
  return settings;
}

RunSettings buckling_run(std::size_t count) {
  RunSettings settings;
  settings.kind = BucklingRun{count};
  return settings;
}

std::vector<double> frequencies(const Model& model, std::size_t count) {
  return solve(model, frequency_run(count), [](const State&) {}).frequencies;
}

std::vector<double> factors(const Model& model, std::size_t count) {
  return solve(model, buckling_run(count), [](const State&) {}).buckling_factors;
}

/// A geodesic sphere: every face of the icosahedron in `frequency`^2 triangles.
ShellMesh geodesic_sphere(double radius, std::size_t frequency) {
  const ShellMesh base = make_sphere(1, 0);
  ShellMesh mesh;
  std::map<std::array<long, 3>, Index> known;
  const auto node = [&](const Vec3& p) {
    const Vec3 n = p.normalized();
    const auto [place, is_new] =
        known.emplace(std::array<long, 3>{std::lround(1e8 * n.x()), std::lround(1e8 * n.y()), std::lround(1e8 * n.z())},
                      static_cast<Index>(mesh.vertices.size()));
    if (is_new) {
      mesh.vertices.push_back(radius * n);
      mesh.normals.push_back(n);
    }
    return place->second;
  };
  for (const auto& t : base.triangles) {
    const Vec3 &a = base.vertices[t[0]], &b = base.vertices[t[1]], &c = base.vertices[t[2]];
    const auto at = [&](std::size_t i, std::size_t j) {
      const double u = static_cast<double>(i) / static_cast<double>(frequency);
      const double v = static_cast<double>(j) / static_cast<double>(frequency);
      return node((1 - u - v) * a + u * b + v * c);
    };
    for (std::size_t i = 0; i < frequency; ++i) {
      for (std::size_t j = 0; i + j < frequency; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (i + j + 1 < frequency) {
          mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
      }
    }
  }
  return mesh;
}

Model free_sphere(std::size_t frequency, double radius, double thickness) {
  Model model;
  ShellBody body = flat_body(geodesic_sphere(radius, frequency), 1000, 0.3, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  body.material.density = 1e-9;
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  return model;
}

/// A cylinder along z with the surface's normals; odd rows shifted by half a cell.
Model cylinder(double radius, double length, double thickness, std::size_t around, std::size_t along) {
  ShellMesh mesh = tube_mesh(radius, radius, length, around, along);
  Model model;
  ShellBody body = flat_body(mesh, 1000, 0.3, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  return model;
}

Model square_plate(std::size_t n, double side, double thickness, Diagonals diagonals) {
  const Grid grid = make_grid(
      n, n, [&](double u, double v) { return Vec3(side * u, side * v, 0); }, diagonals);
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0.3, thickness));
  model.shells[0].material.density = 1e-9;
  return model;
}

/// omega a^2 sqrt(rho t / D) of the lowest modes.
std::vector<double> plate_numbers(const Model& model, double side, double thickness, std::size_t count) {
  const double d = 1000 * std::pow(thickness, 3) / (12 * 0.91);
  std::vector<double> numbers;
  for (const double f : frequencies(model, count)) {
    numbers.push_back(2 * pi * f * side * side * std::sqrt(1e-9 * thickness / d));
  }
  return numbers;
}

/// Pressure that follows the wall turns with it: the six rigid motions have no frequency, and the lowest modes are
/// five.
TEST(Modes, OfABallUnderPressureEndAndLeaveOutItsRigidMotions) {
  Model model = free_sphere(8, 20, 1);
  const double at_rest = frequencies(model, 1).front();
  Load load;
  load.kind = PressureLoad{1, true};  // a thousandth of Young's modulus: strains of .7 %
  model.loads.push_back(load);
  const std::vector<double> found = frequencies(model, 6);
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_NEAR(found[k] / found[0], 1, 2e-3) << k;
  }
  EXPECT_GT(found[0], 1.005 * at_rest);
  EXPECT_LT(found[0], 1.1 * at_rest);
  EXPECT_GT(found[5], 1.1 * found[4]);
}

TEST(Lanczos, FindsTheEigenvaluesOfADenseProblem) {
  constexpr Eigen::Index n = 120;
  std::srand(4);
  const Eigen::MatrixXd random = Eigen::MatrixXd::Random(n, n);
  const Eigen::MatrixXd a = random * random.transpose() + Eigen::MatrixXd::Identity(n, n);
  Eigen::MatrixXd b = Eigen::MatrixXd::Random(n, n);
  b = (b + b.transpose()).eval();
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> exact(b, a);
  const Eigen::LLT<Eigen::MatrixXd> factor(a);
  const SymmetricPencil pencil{[&](const VectorX& x, VectorX& y) { y = factor.solve(x); },
                               [&](const VectorX& x, VectorX& y) { y = a * x; },
                               [&](const VectorX& x, VectorX& y) { y = b * x; }};
  const std::vector<bool> all(n, true);
  for (const std::size_t count : {1U, 5U, 20U, 120U}) {
    LanczosOptions options;
    options.count = count;
    const EigenPairs pairs = largest_eigenpairs(pencil, all, {}, options);
    ASSERT_TRUE(pairs.converged);
    ASSERT_EQ(pairs.values.size(), count);
    for (std::size_t k = 0; k < count; ++k) {
      EXPECT_NEAR(pairs.values[k], exact.eigenvalues()[n - 1 - static_cast<Eigen::Index>(k)],
                  1e-10 * pairs.largest_magnitude);
    }
  }
}

TEST(Lanczos, FindsAllCopiesAndLeavesDeflatedVectorsOut) {
  // 1, 1/2 (six times), 1/3 ...; the first is deflated.
  constexpr Eigen::Index n = 400;
  VectorX values(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    values[i] = 1.0 / static_cast<double>(i == 0 ? 1 : i < 7 ? 2 : i - 4);
  }
  const SymmetricPencil pencil{[](const VectorX& x, VectorX& y) { y = x; }, [](const VectorX& x, VectorX& y) { y = x; },
                               [&](const VectorX& x, VectorX& y) { y = values.cwiseProduct(x); }};
  LanczosOptions options;
  options.count = 9;
  const EigenPairs pairs =
      largest_eigenpairs(pencil, std::vector<bool>(n, true), {VectorX(3 * VectorX::Unit(n, 0))}, options);
  ASSERT_TRUE(pairs.converged);
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_NEAR(pairs.values[k], values[static_cast<Eigen::Index>(k) + 1], 1e-10);
    for (std::size_t j = 0; j <= k; ++j) {
      EXPECT_NEAR(pairs.vectors[k].dot(pairs.vectors[j]), j == k ? 1 : 0, 1e-10);
    }
  }
}

bool on_edge(const Vec3& p) { return p.x() < eps || p.y() < eps || p.x() > 10 - eps || p.y() > 10 - eps; }

TEST(Frequencies, ClampedAndSupportedPlates) {
  for (const Diagonals diagonals : {Diagonals::one, Diagonals::random}) {
    for (const bool clamped : {true, false}) {
      std::vector<double> errors;
      for (const std::size_t n : {8U, 16U, 32U}) {
        Model model = square_plate(n, 10, 0.05, diagonals);
        hold(model, on_edge, "xyz", clamped ? "xyz" : "");
        errors.push_back(plate_numbers(model, 10, 0.05, 1)[0] / (clamped ? 35.985 : 19.739) - 1);
      }
      EXPECT_LT(std::abs(errors[2]), 0.002);
      EXPECT_NEAR(std::log2(errors[0] / errors[2]) / 2, 2, 0.3);
    }
  }
}

TEST(Frequencies, HigherModesOfASupportedPlate) {
  Model model = square_plate(32, 10, 0.05, Diagonals::alternating);
  hold(model, on_edge, "xyz", "");
  const std::vector<double> numbers = plate_numbers(model, 10, 0.05, 10);
  const std::vector<double> squares{2, 5, 5, 8, 10, 10, 13, 13, 17, 17};  // m^2 + n^2
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_NEAR(numbers[k], pi * pi * squares[k], 0.01 * numbers[k]);
  }
}

TEST(Frequencies, FreePlateHasNoFrequencyForItsRigidMotions) {
  // Nothing held; Leissa 1973 by more terms.
  const std::vector<double> numbers = plate_numbers(square_plate(24, 10, 0.05, Diagonals::alternating), 10, 0.05, 3);
  EXPECT_NEAR(numbers[0], 13.468, 0.01 * 13.468);
  EXPECT_NEAR(numbers[1], 19.596, 0.01 * 19.596);
  EXPECT_NEAR(numbers[2], 24.270, 0.01 * 24.270);
}

TEST(Frequencies, HeldAtOnePointOnlyTheOtherRigidMotionsAreLeftOut) {
  // On a ball joint at its centre of mass a plate keeps its free modes that do not move there.
  const Model loose = square_plate(8, 10, 0.05, Diagonals::alternating);
  Model jointed = loose;
  hold(
      jointed, [](const Vec3& p) { return (p - Vec3(5, 5, 0)).norm() < eps; }, "xyz", "");
  // The twisting mode, the first of a free plate, rests there; it comes second after one in which the corners rise.
  const double twist = frequencies(loose, 1)[0];
  EXPECT_NEAR(frequencies(jointed, 2)[1], twist, 1e-6 * twist);
  EXPECT_GT(frequencies(jointed, 1)[0], 0.5 * twist);
}

/// Omega^2 of the lower spheroidal branch with bending. Source: Junger, Feit 1986, Sound, structures and their
/// interaction, section 7.13.
double sphere_number(int n, double thickness_over_radius) {
  const double nu = 0.3;
  const double b = thickness_over_radius * thickness_over_radius / 12;
  const double s = n * (n + 1);
  const double linear = 1 + 3 * nu + s - b * (1 - nu - s * s - nu * s);
  const double constant = (s - 2) * (1 - nu * nu) + b * (s * s * s - 4 * s * s + s * (5 - nu * nu) - 2 * (1 - nu * nu));
  const double omega_squared = (linear - std::sqrt(linear * linear - 4 * constant)) / 2;  // over E / (1 - nu^2)
  return std::sqrt(omega_squared / (1 - nu * nu));
}

/// Mean over the 2 n + 1 modes of n = 2 ... 5, over the exact value, - 1.
std::array<double, 4> sphere_errors(const Model& model, double thickness_over_radius) {
  const std::vector<double> f = frequencies(model, 32);
  std::array<double, 4> errors{};
  std::size_t first = 0;
  for (int n = 2; n <= 5; ++n) {
    double mean = 0;
    const auto copies = static_cast<std::size_t>(2 * n + 1);
    for (std::size_t k = first; k < first + copies; ++k) {
      mean += 2 * pi * f[k] * 10 * std::sqrt(1e-9 / 1000) / static_cast<double>(copies);
    }
    errors[static_cast<std::size_t>(n - 2)] = mean / sphere_number(n, thickness_over_radius) - 1;
    first += copies;
  }
  return errors;
}

TEST(Frequencies, SphereMembraneModes) {
  EXPECT_NEAR(sphere_number(2, 0), 0.7348, 1e-4);
  EXPECT_NEAR(sphere_number(5, 0), 0.9492, 1e-4);
  const std::array<double, 4> coarse = sphere_errors(free_sphere(8, 10, 0.2), 0.02);
  const std::array<double, 4> fine = sphere_errors(free_sphere(16, 10, 0.2), 0.02);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_LT(std::abs(coarse[k]), 0.02) << k + 2;
    EXPECT_LT(std::abs(fine[k]), 0.006) << k + 2;
  }
}

TEST(Frequencies, VeryThinSphereHasNoSoftPatternsOfItsMesh) {
  // Elements of h^2 = 6 and 11 R t: what alternates from node to node must not be softer than the membrane's modes.
  for (const double thickness : {0.04, 0.02}) {
    for (const double error : sphere_errors(free_sphere(8, 10, thickness), thickness / 10)) {
      EXPECT_LT(std::abs(error), 0.01) << thickness;
    }
  }
}

/// A supported square plate pulled in its plane by a force per length on all sides.
Model pulled_plate(std::size_t n, double force) {
  Model model = square_plate(n, 10, 0.05, Diagonals::alternating);
  hold(model, on_edge, "z", "");
  hold(
      model, [](const Vec3& p) { return p.norm() < eps; }, "xy", "");
  hold(
      model, [](const Vec3& p) { return (p - Vec3(10, 0, 0)).norm() < eps; }, "y", "");
  const auto edges = [&](int axis, double at) {
    EdgeLoad load{{}, (at > 5 ? force : -force) * Vec3::Unit(axis)};
    const ShellMesh& mesh = model.shells[0].mesh;
    for (const auto& t : mesh.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index a = t[k];
        const Index b = t[(k + 1) % 3];
        if (std::abs(mesh.vertices[a][axis] - at) < eps && std::abs(mesh.vertices[b][axis] - at) < eps) {
          load.edges.push_back({a, b});
        }
      }
    }
    model.loads.push_back({0, load, {}});
  };
  for (const int axis : {0, 1}) {
    edges(axis, 0);
    edges(axis, 10);
  }
  return model;
}

double critical_force() { return 2 * pi * pi * 1000 * std::pow(0.05, 3) / (12 * 0.91) / 100; }

TEST(Frequencies, LoadsChangeThem) {
  // omega^2 = omega0^2 (1 + N / N_critical).
  for (const bool linear : {true, false}) {
    RunSettings settings = frequency_run(1);
    std::get<FrequencyRun>(settings.kind).preload.linear = linear;
    const auto first = [&](double part) {
      return solve(pulled_plate(16, part * critical_force()), settings, [](const State&) {}).frequencies[0];
    };
    const double unloaded = first(1e-9);
    EXPECT_NEAR(std::pow(first(3) / unloaded, 2), 4, 0.03);
    EXPECT_NEAR(std::pow(first(-0.5) / unloaded, 2), 0.5, 0.005);
    if (linear) {
      EXPECT_THROW(first(-1.5), RequirementError);
    } else {
      EXPECT_GT(first(-1.5), 0) << "of the buckled plate";
    }
  }
}

TEST(Frequencies, ModesAreHandedOver) {
  Model model = square_plate(8, 10, 0.05, Diagonals::one);
  hold(model, on_edge, "xyz", "");
  std::vector<State> states;
  const Summary summary = solve(model, frequency_run(4), [&](const State& state) { states.push_back(state); });
  ASSERT_EQ(states.size(), 5U);  // the reference first
  ASSERT_EQ(summary.frequencies.size(), 4U);
  EXPECT_TRUE(summary.converged);
  EXPECT_EQ(states[0].time, 0);
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_NEAR(states[k].time, summary.frequencies[k - 1], 1e-12 * states[k].time);
    EXPECT_GT(states[k].time, states[k - 1].time);
    EXPECT_LT(states[k].residual, 1e-8);
    double largest = 0;
    for (const Vec3& u : states[k].displacement) {
      largest = std::max(largest, u.norm());
    }
    EXPECT_NEAR(largest, 0.1, 1e-12);  // 1 % of the side
  }
}

TEST(Frequencies, DoNotDependOnTheUnitOfLength) {
  std::array<double, 2> first{};
  for (std::size_t k = 0; k < 2; ++k) {
    const double unit = k == 0 ? 1 : 1e-3;
    Model model = free_sphere(4, 10, 0.2);
    for (Vec3& v : model.shells[0].mesh.vertices) {
      v *= unit;
    }
    model.shells[0].thickness = {0.2 * unit};
    first[k] = frequencies(model, 3)[2] * unit;
  }
  EXPECT_NEAR(first[1] / first[0], 1, 1e-9);
}

TEST(Buckling, SphereUnderExternalPressure) {
  const double p = 2 * 1000 / std::sqrt(3 * 0.91) * 0.02 * 0.02;
  const auto error = [&](std::size_t f) {
    Model model = free_sphere(f, 10, 0.2);
    model.loads.push_back({0, PressureLoad{-p, true}, {}});
    return factors(model, 3)[0] - 1;
  };
  const double e8 = error(8);
  const double e16 = error(16);
  EXPECT_LT(std::abs(e8), 0.08);
  EXPECT_LT(std::abs(error(12)), 0.05);  // 2,880 triangles
  EXPECT_LT(std::abs(e16), 0.03);
}

TEST(Buckling, LongCylinderUnderExternalPressure) {
  // Plane strain: held along the axis at both ends; 3,200 triangles.
  Model model = cylinder(10, 100, 0.2, 40, 40);
  hold(
      model, [](const Vec3& p) { return p.z() < eps || p.z() > 100 - eps; }, "z", "xy");
  model.fixes.push_back({0, {0}, {true, true, false}, {false, false, false}, Vec3::Zero(), {}});
  model.fixes.push_back({0, {20}, {false, true, false}, {false, false, false}, Vec3::Zero(), {}});
  const double p = 1000 * std::pow(0.02, 3) / (4 * 0.91);
  model.loads.push_back({0, PressureLoad{-p, true}, {}});
  const std::vector<double> found = factors(model, 4);
  EXPECT_NEAR(found[0], 1, 0.01);
  EXPECT_NEAR(found[1], 1, 0.01);
  EXPECT_NEAR(found[2], (9.0 - 1) / (4 - 1), 0.03);  // three waves: (n^2 - 1) / 3
}

TEST(Buckling, CylinderUnderAxialForce) {
  Model model = cylinder(10, 20, 0.2, 48, 32);
  hold(
      model, [](const Vec3& p) { return p.z() < eps; }, "xyz", "");
  hold(
      model, [](const Vec3& p) { return p.z() > 20 - eps; }, "xy", "");
  const double stress = 1000 * 0.02 / std::sqrt(3 * 0.91);
  EdgeLoad load{{}, Vec3(0, 0, -stress * 0.2)};
  for (Index i = 0; i < 48; ++i) {
    load.edges.push_back({32 * 48 + i, 32 * 48 + (i + 1) % 48});
  }
  model.loads.push_back({0, load, {}});
  EXPECT_NEAR(factors(model, 2)[0], 1, 0.1);
}

/// No stress in their middle, nothing to buckle: they stiffen as they bend.
TEST(Buckling, PlatesThatArePressedAsideDoNot) {
  for (const double pressure : {2e-5, -2e-5}) {
    Model plate = square_plate(16, 40, 1, Diagonals::alternating);
    hold(plate, on_edge, "xyz", "xyz");
    plate.loads.push_back({0, PressureLoad{pressure, true}, {}});
    EXPECT_THROW(factors(plate, 2), RequirementError);
  }
  const Grid grid = make_grid(20, 2, [](double u, double v) { return Vec3(10 * u, v, 0); });
  Model strip;
  strip.shells.push_back(flat_body(grid.mesh, 0.1, 0.3, 0.1));
  hold(
      strip, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
  strip.loads.push_back({0, EdgeLoad{{{grid.node(20, 0), grid.node(20, 1)}}, Vec3(0, 0, 1e-7)}, {}});
  EXPECT_THROW(factors(strip, 2), RequirementError);
}

TEST(Buckling, Columns) {
  // One end clamped, a dead force at the other: (2 k - 1)^2 times the first.
  for (const std::size_t n : {8U, 16U, 32U}) {
    const Grid grid = make_grid(n, 1, [](double u, double v) { return Vec3(10 * u, v, 0); });
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 1000, 0, 0.1));
    hold(
        model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
    const double critical = pi * pi * 1000 * 1e-3 / 12 / 400;
    model.loads.push_back({0, EdgeLoad{{{grid.node(n, 0), grid.node(n, 1)}}, Vec3(-critical, 0, 0)}, {}});
    const std::vector<double> found = factors(model, 3);
    EXPECT_NEAR(found[0], 1, 4e-4);
    EXPECT_NEAR(found[1] / 9, 1, 4e-3);
    EXPECT_NEAR(found[2] / 25, 1, 0.012);
  }
}

/// Clamped at one end, a dead force of so many critical ones at the other.
Model cantilever_column(double part) {
  constexpr std::size_t n = 16;
  const Grid grid = make_grid(n, 1, [](double u, double v) { return Vec3(10 * u, v, 0); });
  const double critical = pi * pi * 1000 * 1e-3 / 12 / 400;
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0, 0.1));
  hold(
      model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
  model.loads.push_back({0, EdgeLoad{{{grid.node(n, 0), grid.node(n, 1)}}, Vec3(-part * critical, 0, 0)}, {}});
  return model;
}

/// mm, by which its end moves to the side.
double moved_aside(double part, const RunSettings& settings, Summary* summary = nullptr) {
  double aside = 0;
  const Summary ended = solve(cantilever_column(part), settings,
                              [&](const State& state) { aside = std::abs(state.displacement.back().z()); });
  if (summary != nullptr) {
    *summary = ended;
  }
  return aside;
}

/// Straight, it is in balance after one iteration, whose tangent is that of the column without load. Deflection of the
/// elastica at 1.5 times the load: Timoshenko, Gere, "Theory of elastic stability", 2.7.
TEST(Buckling, AColumnBeyondItsLoadIsNoStateOfRest) {
  for (const Solver solver : {Solver::direct, Solver::cg}) {
    for (const double tolerance : {1e-8, 0.05, 0.5}) {  // of cg
      RunSettings settings = nonlinear_run({1});
      settings.solver = solver;
      settings.cg_tolerance = tolerance;
      EXPECT_LT(moved_aside(0.9, settings), 1e-6) << tolerance;
      EXPECT_NEAR(moved_aside(1.5, settings), 7.9, 0.1) << tolerance;
    }
  }
}

TEST(Buckling, WhatAColumnComesToDependsOnNoStepsAndNoTolerance) {
  const double reference = moved_aside(1.5, nonlinear_run({1}));
  for (const double first : {0.5, 2.0 / 3, 0.9}) {  // the second is critical
    EXPECT_NEAR(moved_aside(1.5, nonlinear_run({first, 1})), reference, 1e-5) << first;
  }
  for (const double converge : {1e-3, 1e-5, 1e-10}) {
    RunSettings settings = nonlinear_run({1});
    settings.converge = converge;
    EXPECT_NEAR(moved_aside(1.5, settings), reference, converge * reference + 1e-4) << converge;
  }
}

/// Just beyond, w = L sqrt(8 (P / Pcr - 1)) 2 / pi to the first order.
TEST(Buckling, JustBeyondItsLoadAColumnRestsAside) {
  const double critical = factors(cantilever_column(1), 1).front();
  for (const double beyond : {1e-3, 4e-3}) {  // the column is shorter by 2e-5 then
    const double elastica = 10 * std::sqrt(8 * beyond) * 2 / pi;
    EXPECT_NEAR(moved_aside(critical * (1 + beyond), nonlinear_run({1})) / elastica, 1, 0.05) << beyond;
  }
}

TEST(Buckling, IsToldOnceHoweverFarItGoesAndInFrequenciesToo) {
  for (const double part : {1.05, 1.5, 3.0}) {
    Summary summary;
    (void)moved_aside(part, nonlinear_run({1}), &summary);
    ASSERT_EQ(summary.snaps.size(), 1U) << part;
    EXPECT_NEAR(summary.snaps[0].load_factor * part, 1, 2e-3);
  }
  Model column = cantilever_column(1.3);
  column.shells[0].material.density = 1e-9;
  RunSettings settings;
  settings.kind = FrequencyRun{2, StaticRun{false, {1}}};
  EXPECT_EQ(solve(column, settings, [](const State&) {}).snaps.size(), 1U);
}

/// Simply supported, 10 mm wide, shortened along x between its supports, free to widen.
Model shortened_plate(std::size_t n, double thickness, double by) {
  Model model = square_plate(n, 10, thickness, Diagonals::alternating);
  hold(model, on_edge, "z", "");
  hold(
      model, [](const Vec3& p) { return p.x() < eps; }, "x", "");
  hold(
      model, [](const Vec3& p) { return p.norm() < eps; }, "y", "");
  hold(
      model, [](const Vec3& p) { return p.x() > 10 - eps; }, "x", "");
  model.fixes.back().displacement = Vec3(-by, 0, 0);
  return model;
}

/// It bulges by less than a quarter of its thickness where it leaves its path.
TEST(Buckling, AShortBulgeOfAPlateIsToldToo) {
  Model model = shortened_plate(12, 0.1, 10);
  const double critical = factors(model, 1)[0];
  for (const double part : {0.9, 3.0}) {
    model.fixes.back().displacement = Vec3(-10 * critical * part, 0, 0);
    const Summary summary = solve(model, nonlinear_run({1}), [](const State&) {});
    EXPECT_EQ(summary.snaps.size(), part > 1 ? 1U : 0U) << part;
  }
}

TEST(Buckling, IterationsThatAreCountedEndUnstableAndSaySo) {
  RunSettings one = nonlinear_run({1});
  one.newton_max = 1;
  RunSettings few = nonlinear_run({1});
  few.solver = Solver::cg;
  few.cg_iterations = 200;
  few.cg_fixed_count = true;
  few.newton_max = 1;
  for (const RunSettings& settings : {one, few}) {
    for (const double part : {0.9, 1.5}) {
      Summary summary;
      (void)moved_aside(part, settings, &summary);
      EXPECT_EQ(summary.ends_unstable, part > 1);
    }
  }
}

TEST(Buckling, APathByArcLengthSaysWhereOthersLeaveItAndThatItEndsUnstable) {
  const double critical = factors(cantilever_column(1), 1).front() / 1.5;
  for (const double first : {1.0, 0.4, 0.1}) {
    RunSettings settings;
    settings.kind = ArcLengthRun{100, first, 1, std::nullopt};
    Summary summary;
    EXPECT_LT(moved_aside(1.5, settings, &summary), 1e-6);
    ASSERT_EQ(summary.branch_factors.size(), 1U) << first;
    EXPECT_NEAR(summary.branch_factors[0], critical, 1e-3 * critical) << first;
    EXPECT_TRUE(summary.ends_unstable);
    (void)moved_aside(0.9, settings, &summary);
    EXPECT_FALSE(summary.ends_unstable);
  }
}

TEST(Buckling, PlatesByForcesAndByPrescribedDisplacement) {
  EXPECT_NEAR(factors(pulled_plate(16, -critical_force()), 1)[0], 1, 0.01);
  // N = 4 pi^2 D / a^2, strain = N / (E t).
  const double strain = 2 * critical_force() / (1000 * 0.05);
  EXPECT_NEAR(factors(shortened_plate(16, 0.05, 10 * strain), 1)[0], 1, 0.01);
}

TEST(Buckling, FactorsScaleWithTheLoad) {
  Model model = free_sphere(4, 10, 0.2);
  model.loads.push_back({0, PressureLoad{-1e-6, true}, {}});
  const double small = factors(model, 1)[0];
  model.loads[0].kind = PressureLoad{-1, true};
  EXPECT_NEAR(small / factors(model, 1)[0], 1e6, 1e6 * 1e-6);
}

TEST(Modes, WhatCannotBeIsRefused) {
  using testing::HasSubstr;
  Model model = free_sphere(2, 10, 0.2);
  EXPECT_THAT(error_of(model, buckling_run(1)), HasSubstr("input: buckling needs a load"));
  EXPECT_THAT(error_of(model, frequency_run(0)), HasSubstr("input: count must be at least 1"));
  EXPECT_THAT(error_of(model, frequency_run(247)), HasSubstr("input: count = 247, but the model has only 246 modes"));
  RunSettings settings = frequency_run(1);
  settings.solver = Solver::cg;
  EXPECT_THAT(error_of(model, settings), HasSubstr("direct solver"));
  // Constant strain: the drilling moments of the others, turned by the deflection, soften coarse plates in tension.
  Model pulled = pulled_plate(4, 1);
  pulled.shells[0].membrane = Membrane::cst;
  EXPECT_THAT(error_of(pulled, buckling_run(1)), HasSubstr("requirement: the loads buckle nothing"));
  model.loads.push_back({0, PressureLoad{1, true}, {}});
  EXPECT_THAT(error_of(model, buckling_run(1)), HasSubstr("requirement: the loads buckle nothing"));
  model.loads.clear();
  model.shells[0].material.density.reset();
  EXPECT_THAT(error_of(model, frequency_run(1)), HasSubstr("needs its density"));
  Model loose = square_plate(2, 10, 0.05, Diagonals::one);
  loose.loads.push_back({0, AreaLoad{Vec3(0, 0, 1)}, {}});
  EXPECT_THAT(error_of(loose, buckling_run(1)), HasSubstr("can move freely"));
  EXPECT_THAT(error_of(loose, frequency_run(1)), HasSubstr("can move freely"));
}

TEST(Modes, AllOfASmallModel) {
  const Model model = free_sphere(1, 10, 0.5);
  const std::vector<double> all = frequencies(model, 66);
  ASSERT_EQ(all.size(), 66U);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  const std::vector<double> few = frequencies(model, 12);
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_NEAR(few[k], all[k], 1e-7 * all[k]);
  }
}

}  // namespace
}  // namespace tunica
