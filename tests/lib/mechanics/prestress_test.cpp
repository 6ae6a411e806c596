// The stress of a wall that was imaged under pressure, against what equilibrium says.

#include "benchmarks.hpp"
#include "tets.hpp"
#include "tunica/mechanics/runs/fields.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

constexpr double pressure = 16e-3;  // MPa: 120 mmHg

double von_mises(double a, double b) { return std::sqrt(a * a - a * b + b * b); }
double von_mises(const Vec3& s) { return std::sqrt(s[0] * s[0] - s[0] * s[1] + s[1] * s[1] + 3 * s[2] * s[2]); }

Model imaged(ShellMesh mesh, double thickness, double young = 2, double poisson = 0.45) {
  Model model;
  ShellBody body = flat_body(std::move(mesh), young, poisson, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  Load load;
  load.kind = PressureLoad{pressure, true, pressure};
  model.loads.push_back(load);
  return model;
}

Model closed(ShellMesh mesh, double thickness, double young = 2, double poisson = 0.45) {
  Model model = imaged(std::move(mesh), thickness, young, poisson);
  model.rigid_motions.push_back({0});
  return model;
}

ElementFields fields_of(const Model& model, const RunSettings& settings = nonlinear_run({1})) {
  const System system(model, settings);
  State last;
  solve(system, [&](const State& state) { last = state; });
  return ElementFieldEvaluator(system)(last);
}

/// Largest error of the membrane forces' von Mises value, relative to the largest one by the formula.
/// @param expected  principal membrane forces at a point, N/mm; zero: not looked at
double error_of_forces(const Model& model, const std::function<Vec2(const Vec3&)>& expected) {
  const ElementFields fields = fields_of(model);
  const ShellMesh& mesh = model.shells[0].mesh;
  double worst = 0, largest = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec2 forces = expected((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
    const double there = von_mises(forces[0], forces[1]);
    largest = std::max(largest, there);
    worst = std::max(worst, there > 0 ? std::abs(von_mises(fields.membrane_force[t]) - there) : 0);
  }
  return worst / largest;
}

/// x^2 + y^2 over a^2, z^2 over b^2.
ShellMesh ellipsoid(double a, double b, std::size_t frequency) {
  ShellMesh mesh = make_geodesic(1, frequency);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3 p = mesh.vertices[i];
    mesh.vertices[i] = Vec3(a * p.x(), a * p.y(), b * p.z());
    mesh.normals[i] = Vec3(p.x() / a, p.y() / a, p.z() / b).normalized();
  }
  return mesh;
}

/// The tube has radius a, its centre line radius b.
ShellMesh torus(double a, double b, std::size_t around, std::size_t along) {
  ShellMesh mesh;
  for (std::size_t j = 0; j < along; ++j) {
    for (std::size_t i = 0; i < around; ++i) {
      const double u = -2 * pi * (static_cast<double>(i) + (j % 2 == 1 ? 0.5 : 0)) / static_cast<double>(around);
      const double v = 2 * pi * static_cast<double>(j) / static_cast<double>(along);
      const Vec3 out(std::cos(v), std::sin(v), 0);
      mesh.normals.push_back(std::cos(u) * out + std::sin(u) * Vec3::UnitZ());
      mesh.vertices.push_back(b * out + a * mesh.normals.back());
    }
  }
  add_tube_triangles(around, along, mesh);
  const std::size_t nodes = mesh.vertices.size();
  for (auto& t : mesh.triangles) {
    for (Index& v : t) {
      v = static_cast<Index>(v % nodes);
    }
  }
  return mesh;
}

/// A tube of any section, along z, that does not lengthen: its ends are planes of symmetry.
Model long_tube(const std::function<std::pair<Vec3, Vec3>(double)>& section, double length, std::size_t around,
                std::size_t along, double thickness, double young = 2) {
  ShellMesh mesh;
  for (std::size_t j = 0; j <= along; ++j) {
    for (std::size_t i = 0; i < around; ++i) {
      const auto [point, normal] =
          section(2 * pi * (static_cast<double>(i) + (j % 2 == 1 ? 0.5 : 0)) / static_cast<double>(around));
      mesh.vertices.push_back(point + length * static_cast<double>(j) / static_cast<double>(along) * Vec3::UnitZ());
      mesh.normals.push_back(normal);
    }
  }
  add_tube_triangles(around, along, mesh);
  Model model = imaged(std::move(mesh), thickness, young);
  hold(
      model, [&](const Vec3& p) { return p.z() < 1e-9 || p.z() > length - 1e-9; }, "z", "xy");
  const double far = model.shells[0].mesh.vertices[0].x();
  hold(
      model, [&](const Vec3& p) { return p.z() < 1e-9 && std::abs(std::abs(p.x()) - far) < 1e-9; }, "y", "");
  hold(
      model, [&](const Vec3& p) { return p.z() < 1e-9 && std::abs(p.x()) < 1e-9; }, "x", "");
  return model;
}

std::pair<Vec3, Vec3> ellipse(double a, double b, double u) {
  return {Vec3(a * std::cos(u), b * std::sin(u), 0), Vec3(std::cos(u) / a, std::sin(u) / b, 0).normalized()};
}

void expect_convergence(const std::function<double(std::size_t)>& error, const std::vector<std::size_t>& sizes,
                        double last, double least_rate) {
  double before = 0;
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    const double now = error(sizes[k]);
    if (k > 0) {
      const double rate =
          std::log(before / now) / std::log(static_cast<double>(sizes[k]) / static_cast<double>(sizes[k - 1]));
      EXPECT_GT(rate, least_rate) << "from " << before << " to " << now;
    }
    before = now;
  }
  EXPECT_LT(before, last);
}

TEST(Prestress, OfASphereIsThatOfEquilibrium) {
  expect_convergence(
      [](std::size_t n) {
        return error_of_forces(closed(make_geodesic(20, n), 1),
                               [](const Vec3&) { return Vec2(pressure * 20 / 2, pressure * 20 / 2); });
      },
      {6, 13}, 0.005, 1.5);
}

TEST(Prestress, OfAnEllipsoidIsThatOfEquilibrium) {
  constexpr double a = 20, b = 30;
  expect_convergence(
      [](std::size_t n) {
        return error_of_forces(closed(ellipsoid(a, b, n), 0.5), [](const Vec3& p) {
          const double s = std::min(1.0, std::hypot(p.x(), p.y()) / a);  // sine of the parameter from the pole
          const double radius2 = a / b * std::sqrt(a * a * (1 - s * s) + b * b * s * s);
          const double radius1 = radius2 * radius2 * radius2 * b * b / (a * a * a * a);
          return Vec2(pressure * radius2 / 2, pressure * radius2 * (1 - radius2 / (2 * radius1)));
        });
      },
      {6, 13}, 0.005, 1.0);
}

TEST(Prestress, OfATorusIsThatOfEquilibriumAwayFromItsTops) {
  constexpr double a = 10, b = 30;
  expect_convergence(
      [](std::size_t n) {
        return error_of_forces(closed(torus(a, b, n, 3 * n), 0.3), [](const Vec3& p) {
          const double out = std::hypot(p.x(), p.y()) - b;  // a sin(phi): at the tops, where it is 0, the membrane
          if (std::abs(out) < 0.5 * a) {                    // theory has no displacements that fit
            return Vec2(0, 0);
          }
          return Vec2(pressure * a / 2, pressure * a * (2 * b + out) / (2 * (b + out)));
        });
      },
      {14, 28}, 0.02, 1.0);
}

/// M(s) = p (mean r^2 - r^2) / 2, N = p times the distance of the tangent from the centre.
TEST(Prestress, OfAnEllipticTubeBendsAsEquilibriumSays) {
  constexpr double a = 12, b = 10, poisson = 0.45;
  const double mean_square = mean_square_of_ellipse(a, b);
  const auto error = [&](std::size_t around, double thickness) {
    const Model model = long_tube([](double u) { return ellipse(a, b, u); }, 12, around, around / 4, thickness);
    const ElementFields fields = fields_of(model);
    const ShellMesh& mesh = model.shells[0].mesh;
    double worst = 0, largest = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [i, j, k] = mesh.triangles[t];
      const Vec3 centre = (mesh.vertices[i] + mesh.vertices[j] + mesh.vertices[k]) / 3;
      const double u = std::atan2(centre.y() / b, centre.x() / a);
      const double square = a * a * std::cos(u) * std::cos(u) + b * b * std::sin(u) * std::sin(u);
      const double force = pressure * a * b / std::hypot(a * std::sin(u), b * std::cos(u));
      const double moment = pressure * (mean_square - square) / 2;
      for (const double side : {1.0, -1.0}) {
        // The moment that stretches the outer face where the section has to become flatter.
        const double hoop = force / thickness + side * 6 * moment / (thickness * thickness);
        const double there = std::abs(hoop) * std::sqrt(1 - poisson + poisson * poisson);
        const double found = side > 0 ? fields.von_mises_top[t] : fields.von_mises_bottom[t];
        largest = std::max(largest, there);
        worst = std::max(worst, std::abs(found - there));
      }
    }
    return worst / largest;
  };
  EXPECT_LT(error(64, 1.5), 0.01);  // what is left is of the order (t / R)^2 / 4 and does not fall any more
  expect_convergence([&](std::size_t around) { return error(around, 0.25); }, {32, 64}, 0.01, 1.0);
}

TEST(Prestress, DoesNotDependOnYoungsModulus) {
  std::vector<std::vector<double>> faces;
  for (const double young : {0.1, 1.0, 30.0, 1000.0}) {
    const ElementFields fields =
        fields_of(long_tube([](double u) { return ellipse(12, 10, u); }, 12, 32, 8, 1.5, young));
    faces.push_back(fields.von_mises_top);
    EXPECT_LT(fields.largest_displacement, 1e-9);
    for (std::size_t t = 0; t < faces[0].size(); ++t) {
      EXPECT_NEAR(faces.back()[t], faces[0][t], 1e-6 * faces[0][t]);
    }
  }
}

TEST(Prestress, IsWhatALinearRunGives) {
  Model model = closed(ellipsoid(20, 30, 6), 0.5);
  const ElementFields stressed = fields_of(model);
  std::get<PressureLoad>(model.loads[0].kind).imaged_at.reset();
  const ElementFields linear = element_fields(model, last_state(model, linear_run()));
  for (std::size_t t = 0; t < linear.von_mises_top.size(); ++t) {
    EXPECT_NEAR(stressed.von_mises_top[t], linear.von_mises_top[t], 1e-6 * linear.von_mises_top[t]);
    EXPECT_NEAR(stressed.von_mises_bottom[t], linear.von_mises_bottom[t], 1e-6 * linear.von_mises_bottom[t]);
  }
}

/// Integral of the trace of the membrane forces over the curved surface = 3 p V.
TEST(Prestress, HoldsTheVirialOfClosedShells) {
  for (const Model& model :
       {closed(make_geodesic(20, 17), 1), closed(ellipsoid(20, 30, 17), 1), closed(torus(10, 30, 28, 84), 0.3)}) {
    const Model& stressed = model;
    const State state = last_state(stressed, nonlinear_run({1}));
    const ElementFields fields = element_fields(stressed, state);
    const ShellMesh& mesh = model.shells[0].mesh;
    double sum = 0;
    const Tessellation patches = tessellate_uniformly(mesh, 8);
    for (std::size_t t = 0; t < patches.mesh.triangles.size(); ++t) {
      const auto& [i, j, k] = patches.mesh.triangles[t];
      const Vec3& a = patches.mesh.vertices[i];
      const double area = (patches.mesh.vertices[j] - a).cross(patches.mesh.vertices[k] - a).norm() / 2;
      const Vec3& force = fields.membrane_force[patches.shell[t]];
      sum += area * (force[0] + force[1]);
    }
    const double wanted = 3 * pressure * *state.volume;
    EXPECT_NEAR(sum, wanted, 0.001 * wanted);
  }
}

/// From 80 to 120 mmHg: (N0 + E t e / (1 - nu)) = p r^2 / (2 R), r = R (1 + e).
TEST(Prestress, IsWhereFurtherPressureBegins) {
  constexpr double radius = 20, thickness = 1, young = 0.5, poisson = 0.45, before = 10.666e-3;
  Model model = closed(make_geodesic(radius, 10), thickness, young, poisson);
  std::get<PressureLoad>(model.loads[0].kind).imaged_at = before;
  const State state = last_state(model, nonlinear_run({0.5, 1}));
  double strain = 0;
  for (int i = 0; i < 100; ++i) {
    strain = (pressure * (1 + strain) * (1 + strain) - before) * radius / 2 * (1 - poisson) / (young * thickness);
  }
  EXPECT_NEAR(state.displacement[7].norm(), strain * radius, 0.005 * strain * radius);
  const ElementFields fields = element_fields(model, state);
  const double force = pressure * radius * (1 + strain) / 2;  // per current length
  EXPECT_NEAR(fields.membrane_force[11][0], force, 0.005 * force);
}

TEST(Prestress, IsAtRestInEveryKindOfRun) {
  Model model = closed(ellipsoid(20, 30, 5), 1);
  model.shells[0].material.density = 1.1e-9;
  for (RunSettings settings : {linear_run(), nonlinear_run({0.3, 1}), RunSettings{}, RunSettings{}}) {
    if (!std::holds_alternative<StaticRun>(settings.kind) || std::get<StaticRun>(settings.kind).load_factors.empty()) {
      DynamicRun dynamic;
      dynamic.duration = 0.02;
      dynamic.step = 2e-3;
      settings.kind = dynamic;
    }
    const State state = last_state(model, settings);
    for (const Vec3& u : state.displacement) {
      EXPECT_LT(u.norm(), 1e-7);
    }
  }
}

/// What long steps take of a motion does not look smaller because the wall was under pressure before.
TEST(Prestress, EnergiesOfAMotionAreThoseSinceTheImage) {
  Model model = closed(make_geodesic(20, 4), 0.5, 200);
  model.shells[0].material.density = 1.1e-9;
  RunSettings settings;
  settings.kind = DynamicRun{0.05, 0.01, {}, Integrator::backward_euler};
  const auto lost = [&](double added_to, double imaged_at) {
    model.loads[0].kind = PressureLoad{imaged_at + added_to, true, imaged_at};
    const EnergyBalance energy = solve(model, settings, [](const State&) {}).energy.value();
    return energy.lost / energy.largest;
  };
  const double at_rest = lost(0.1 * pressure, 0);
  EXPECT_GT(at_rest, 0.3);
  EXPECT_NEAR(lost(0.1 * pressure, pressure), at_rest, 0.05 * at_rest);
}

/// A sphere in tension rings higher than one at rest: w^2 of every mode grows.
/// Suction on a sphere below and above its buckling load, 2 E t^2 / (R^2 sqrt(3 (1 - nu^2))).
TEST(Prestress, SaysWhetherTheImageIsAStableStateOfRest) {
  const double critical = 2 * 2 * 0.25 * 0.25 / (100 * std::sqrt(3 * (1 - 0.45 * 0.45)));
  for (const auto& [suction, stable] : {std::pair(0.5 * critical, true), {1.5 * critical, false}}) {
    Model model = closed(make_sphere(10, 4), 0.25);
    model.loads[0].kind = PressureLoad{-suction, true, -suction};
    EXPECT_EQ(System(model, nonlinear_run({1})).rests_as_imaged(), stable) << suction;
    model.shells[0].material.young_stated = false;
    EXPECT_EQ(System(model, nonlinear_run({1})).rests_as_imaged(), std::nullopt);
  }
}

TEST(Prestress, RaisesFrequencies) {
  Model model = closed(make_geodesic(20, 6), 0.5);
  model.shells[0].material.density = 1.1e-9;
  RunSettings settings;
  FrequencyRun run;
  run.count = 4;
  run.preload.load_factors = {1};
  settings.kind = run;
  const auto frequencies = [&](const Model& of) { return solve(of, settings, [](const State&) {}).frequencies; };
  const std::vector<double> tense = frequencies(model);
  model.loads.clear();
  const std::vector<double> at_rest = frequencies(model);
  for (std::size_t k = 0; k < tense.size(); ++k) {
    EXPECT_GT(tense[k], 1.001 * at_rest[k]);
  }
}

/// A ball of rubber whose surface is pressed: everywhere hydrostatic, and at rest.
TEST(Prestress, OfSolidsIsInBalanceToo) {
  for (const SolidLaw law : {SolidLaw::corotational, SolidLaw::neo_hookean}) {
    Model model = one_solid(make_block(3, 3, 3, [](const Vec3& p) { return p; }), 0.1, 0.45, law);
    Load load;
    load.kind = PressureLoad{-0.02, true, -0.02};
    model.loads.push_back(load);
    hold_nodes(
        model, 0, [](const Vec3& p) { return p.x() < 1e-9; }, "x");
    hold_nodes(
        model, 0, [](const Vec3& p) { return p.y() < 1e-9; }, "y");
    hold_nodes(
        model, 0, [](const Vec3& p) { return p.z() < 1e-9; }, "z");
    const Model& stressed = model;
    const State state = last_state(stressed, nonlinear_run({1}));
    const ElementFields fields = element_fields(stressed, state);
    for (const Vec3& u : state.displacement) {
      EXPECT_LT(u.norm(), 1e-9);
    }
    for (const double p : fields.solid_pressure) {
      EXPECT_NEAR(p, 0.02, 1e-9);
    }
    Model more = stressed;
    std::get<PressureLoad>(more.loads[0].kind).value = -0.03;
    const State pressed = last_state(more, nonlinear_run({1}));
    EXPECT_GT(pressed.displacement.back().norm(), 1e-3);
  }
}

/// An open shell that nothing holds: its rim bears the thrust of what continued it.
TEST(Prestress, AsksForSomethingThatBearsThePressure) {
  ShellMesh half = make_geodesic(20, 6);
  std::erase_if(half.triangles, [&](const auto& t) {
    return std::any_of(t.begin(), t.end(), [&](Index v) { return half.vertices[v].z() < -1e-9; });
  });
  Model model = imaged(half, 1);
  model.shells[0].material.density = 1.1e-9;
  RunSettings settings;
  settings.kind = DynamicRun{0.01, 1e-3, {}, Integrator::backward_euler};
  EXPECT_THAT(error_of(model, settings), testing::HasSubstr("hold it by a fix"));
}

}  // namespace
}  // namespace tunica
