// What the wall bears: Cauchy stress against equilibrium, recovered fields, and what is left out of the statistics.

#include "tunica/mechanics/runs/fields.hpp"
#include "benchmarks.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/disturbed.hpp"
#include "tunica/mechanics/runs/doubts.hpp"
#include "tunica/mechanics/solids/solid_element.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

/// A tube along z; x and y axes of its section.
Model tube(double a, double b, double length, std::size_t around, std::size_t along, double thickness) {
  ShellMesh mesh = tube_mesh(a, b, length, around, along);
  Model model;
  ShellBody body = flat_body(std::move(mesh), 2, 0.45, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  return model;
}

/// Its ends are planes of symmetry.
void hold_as_long(Model& model, double length) {
  hold(
      model, [&](const Vec3& p) { return p.z() < eps || p.z() > length - eps; }, "z", "xy");
  const double far = model.shells[0].mesh.vertices[0].x();
  hold(
      model, [&](const Vec3& p) { return p.z() < eps && std::abs(std::abs(p.x()) - far) < eps; }, "y", "");
  hold(
      model, [&](const Vec3& p) { return p.z() < eps && std::abs(p.x()) < eps; }, "x", "");
}

void press(Model& model, double pressure) {
  Load load;
  load.kind = PressureLoad{pressure, true};
  model.loads.push_back(load);
}

/// Means at the nodes of what the triangles hold, by area: what is compared with.
std::vector<double> nodal_means(const Model& model, const std::vector<double>& of_triangles) {
  const ShellMesh& mesh = model.shells[0].mesh;
  std::vector<double> sum(mesh.vertices.size(), 0), weight(mesh.vertices.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const double area = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]).norm() / 2;
    for (const Index node : mesh.triangles[t]) {
      sum[node] += area * of_triangles[t];
      weight[node] += area;
    }
  }
  for (std::size_t i = 0; i < sum.size(); ++i) {
    sum[i] /= weight[i] > 0 ? weight[i] : 1;
  }
  return sum;
}

/// p r / (2 t), with the radius and the thickness of the blown sphere.
TEST(Fields, OfABlownSphereAreCauchyStresses) {
  constexpr double poisson = 0.45, radius = 10, thickness = 0.2, young = 2;
  for (const double strain : {0.05, 0.2}) {
    Model model = pressurised_sphere(3, thickness, 0);
    model.shells[0].material = {young, poisson, {}};
    model.loads.clear();
    press(model, 2 * young * thickness * strain / ((1 - poisson) * radius * (1 + strain) * (1 + strain)));
    const State state = last_state(model, nonlinear_run({0.5, 1}));
    const double r = (model.shells[0].mesh.vertices[20] + state.displacement[20]).norm();
    EXPECT_NEAR(r / radius - 1, strain, 0.01 * strain);
    const double t = thickness * std::pow(r / radius, -2 * poisson / (1 - poisson));
    const double stress = std::get<PressureLoad>(model.loads[0].kind).value * r / (2 * t);
    const ElementFields fields = element_fields(model, state);
    EXPECT_NEAR(fields.wall.membrane_p99, stress, 0.003 * stress);
    EXPECT_NEAR(fields.wall.stress_p99, stress, 0.01 * stress);
    EXPECT_NEAR(fields.wall.tension_p99, stress * t, 0.003 * stress * t);
    EXPECT_NEAR(fields.membrane_von_mises[7], stress, 0.003 * stress);
    EXPECT_NEAR(fields.tension[7], stress * t, 0.003 * stress * t);
    EXPECT_EQ(fields.wall.left_out, 0);
  }
}

/// p r / t around; along, nu times the force per reference length, over the current one.
TEST(Fields, OfABlownTubeAreCauchyStresses) {
  constexpr double poisson = 0.45, radius = 25, thickness = 1.5, young = 2, length = 20;
  for (const double strain : {0.05, 0.12, 0.2}) {
    Model model = tube(radius, radius, length, 40, 8, thickness);
    hold_as_long(model, length);
    const double pressure = young * thickness * strain / ((1 - poisson * poisson) * radius * (1 + strain));
    press(model, pressure);
    const State state = last_state(model, nonlinear_run({0.5, 1}));
    const std::size_t middle = 4 * 40;
    const double r = (model.shells[0].mesh.vertices[middle] + state.displacement[middle]).head<2>().norm();
    EXPECT_NEAR(r / radius - 1, strain, 0.02 * strain);
    const double t = thickness * std::pow(r / radius, -poisson / (1 - poisson));
    const double hoop = pressure * r / t, axial = poisson * hoop / (r / radius);
    const double stress = std::sqrt(hoop * hoop - hoop * axial + axial * axial);
    const WallNumbers whole = element_fields(model, state).wall.whole;
    EXPECT_NEAR(whole.membrane_p99, stress, 0.003 * stress);
    EXPECT_NEAR(whole.tension_p99, hoop * t, 0.003 * hoop * t);
  }
}

/// Stretched along x and z, free along y: force over the current section.
TEST(Fields, OfACorotationalSolidAreCauchyStresses) {
  constexpr double young = 2, poisson = 0.45;
  Corners4 corners;
  corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  const SolidElement element = make_solid_element(corners, {young, poisson, {}}, SolidLaw::corotational);
  const Vec3 stretch(1.2, 0.9, 1.05);
  SolidMotion motion;
  motion.displacement = (stretch - Vec3::Ones()).asDiagonal() * corners;
  motion.pressure.setZero();
  SolidResponse response;
  ASSERT_TRUE(solid_response(element, motion, response, nullptr));
  const Mat3 stress = solid_stress(element, motion, false);
  const double piola = 6 * response.force[4];  // of the second corner: volume 1/6 times its coordinate's gradient, 1
  EXPECT_NEAR(stress(0, 0), piola / (stretch[1] * stretch[2]), 1e-9);
  EXPECT_NEAR(stress(0, 1), 0, 1e-12);
}

/// Exact but for what the wall's curvature couples, t^2 / (12 R^2): M(s) = p (mean r^2 - r^2) / 2, N = p times the
/// distance of the tangent from the centre.
TEST(Fields, RecoveredAreNearerToEquilibriumThanMeansAtTheNodes) {
  constexpr double a = 12, b = 10, thickness = 1.5, length = 12, pressure = 16e-3, poisson = 0.45;
  const double mean_square = mean_square_of_ellipse(a, b);
  std::array<std::array<double, 2>, 2> errors{};  // of the size: recovered, means
  for (std::size_t n = 0; n < 2; ++n) {
    const std::size_t around = n == 0 ? 24 : 48;
    Model model = tube(a, b, length, around, around / 4, thickness);
    hold_as_long(model, length);
    press(model, pressure);
    const ElementFields fields = element_fields(model, last_state(model, linear_run()));
    const std::vector<double> top = nodal_means(model, fields.von_mises_top);
    const std::vector<double> bottom = nodal_means(model, fields.von_mises_bottom);
    double largest = 0;
    for (std::size_t i = 0; i < top.size(); ++i) {
      const Vec3& p = model.shells[0].mesh.vertices[i];
      const double square = p.head<2>().squaredNorm();
      const double force = pressure / std::hypot(p.x() / (a * a), p.y() / (b * b));
      const double moment = std::abs(pressure * (mean_square - square) / 2);
      const double there =
          (force / thickness + 6 * moment / (thickness * thickness)) * std::sqrt(1 - poisson + poisson * poisson);
      largest = std::max(largest, there);
      errors[n][0] = std::max(errors[n][0], std::abs(fields.von_mises[i] - there));
      errors[n][1] = std::max(errors[n][1], std::abs(std::max(top[i], bottom[i]) - there));
    }
    for (double& error : errors[n]) {
      error /= largest;
    }
  }
  EXPECT_LT(errors[0][0], 0.7 * errors[0][1]);
  EXPECT_LT(errors[1][0], 0.7 * errors[1][1]);
  EXPECT_LT(errors[1][0], 0.02);
}

/// A plate that is stretched by u = sin x: of the strain cos x the shells have means.
TEST(Fields, RecoveredConvergeFasterThanMeansAtTheNodes) {
  std::array<std::array<double, 4>, 2> errors{};  // of the size: recovered, means; the same away from the edges
  for (std::size_t k = 0; k < 2; ++k) {
    const std::size_t n = k == 0 ? 8 : 16;
    const Grid grid = make_grid(n, n, [](double u, double v) { return Vec3(u, v, 0); });
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 1, 0, 0.1));
    State state;
    state.linear = true;
    for (const Vec3& p : grid.mesh.vertices) {
      state.displacement.emplace_back(std::sin(p.x()), 0, 0);
      state.rotation.emplace_back(Vec3::Zero());
    }
    const ElementFields fields = element_fields(model, state);
    const std::vector<double> means = nodal_means(model, fields.von_mises_top);
    for (std::size_t i = 0; i < means.size(); ++i) {
      const Vec3& p = grid.mesh.vertices[i];
      const bool is_inside = (p.head<2>() - Vec2(0.5, 0.5)).cwiseAbs().maxCoeff() < 0.26;
      for (const std::size_t first : {std::size_t{0}, std::size_t{2}}) {
        if (first == 0 || is_inside) {
          errors[k][first] = std::max(errors[k][first], std::abs(fields.von_mises[i] - std::cos(p.x())));
          errors[k][first + 1] = std::max(errors[k][first + 1], std::abs(means[i] - std::cos(p.x())));
        }
      }
    }
  }
  const auto rate = [&](std::size_t which) { return std::log2(errors[0][which] / errors[1][which]); };
  EXPECT_LT(errors[1][0], 0.9 * errors[1][1]);  // of the first order at the edges, as they are
  EXPECT_GT(rate(2), 3) << errors[1][2];
  EXPECT_LT(rate(3), 2.2) << errors[1][3];
}

/// Two plates that meet at a right angle: a pull in one is not smeared into the other.
TEST(Fields, StayOnTheirSideOfACrease) {
  Grid grid = make_grid(8, 4, [](double u, double v) { return u < 0.5 ? Vec3(2 * u, v, 0) : Vec3(1, v, 2 * u - 1); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1, 0, 0.1));
  State state;
  state.linear = true;
  for (const Vec3& p : grid.mesh.vertices) {
    state.displacement.emplace_back(0.01 * p.x(), 0, 0);
    state.rotation.emplace_back(Vec3::Zero());
  }
  const ElementFields fields = element_fields(model, state);
  for (std::size_t i = 0; i < grid.mesh.vertices.size(); ++i) {
    const Vec3& p = grid.mesh.vertices[i];
    if (p.x() < 1 - eps) {
      EXPECT_NEAR(fields.von_mises[i], 0.01, 1e-8);
    } else if (p.z() > eps) {
      EXPECT_NEAR(fields.von_mises[i], 0, 1e-8);
    }
  }
  EXPECT_NEAR(fields.wall.whole.stress_p99, 0.01, 1e-8);
}

/// Half of the thickness over the radius of a tube; a plate leaves nothing open.
TEST(Fields, WhatIsOpenAtTheFacesIsThicknessOverRadius) {
  EXPECT_NEAR(open_at_faces(tube(10, 10, 30, 40, 20, 0.8)), 0.04, 4e-4);
  Model plate;
  plate.shells.push_back(flat_body(make_grid(3, 3, [](double u, double v) { return Vec3(u, v, 0); }).mesh, 1, 0, 1));
  EXPECT_EQ(open_at_faces(plate), 0);
  EXPECT_EQ(open_at_faces(Model()), 0);
}

/// Four bending lengths of a tube that is clamped at both ends, and no more.
TEST(Fields, WhatIsNearRimsIsLeftOut) {
  constexpr double radius = 10, thickness = 0.5, length = 60;
  Model model = tube(radius, radius, length, 40, 48, thickness);
  hold(
      model, [&](const Vec3& p) { return p.z() < eps || p.z() > length - eps; }, "xyz", "xyz");
  press(model, 1e-3);
  const Wall wall = element_fields(model, last_state(model, linear_run())).wall;
  EXPECT_NEAR(wall.left_out, 4 * std::sqrt(radius * thickness) / length, 0.003);
  EXPECT_FALSE(wall.is_all_near);
  EXPECT_TRUE(wall.is_max_on_held);
  EXPECT_GT(wall.whole.stress_max, 1.2 * wall.stress_max);
  const double hoop = 1e-3 * radius / thickness;
  EXPECT_NEAR(wall.membrane_p99, hoop * std::sqrt(1 - 0.45 + 0.45 * 0.45), 0.06 * hoop);

  Model cap = tube(radius, radius, 5, 40, 4, thickness);
  hold(
      cap, [&](const Vec3& p) { return p.z() < eps; }, "xyz", "xyz");
  press(cap, 1e-3);
  const Wall all = element_fields(cap, last_state(cap, linear_run())).wall;
  EXPECT_TRUE(all.is_all_near);
  EXPECT_EQ(all.left_out, 0);
  EXPECT_EQ(all.stress_p99, all.whole.stress_p99);
}

/// The region is the wall's, whatever the shells: distances do not go along edges, and normals that waver from node to
/// node, as those of shells finer than the facets behind them do, are no curvature.
TEST(Fields, WhatIsLeftOutDoesNotDependOnTheShells) {
  constexpr double radius = 10, thickness = 0.5, length = 40;
  const double wanted = 4 * std::sqrt(radius * thickness) / length;
  for (const std::size_t n : {20, 40, 160}) {
    for (const double waver : {0.0, 0.02}) {
      Model model = tube(radius, radius, length, 2 * n, n, thickness);
      ShellMesh& mesh = model.shells[0].mesh;
      for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
        Vec3& x = mesh.vertices[i];  // skewed: no edge goes straight to a rim
        const double angle = 0.8 * x.z() / length;
        const Vec3 normal = mesh.normals[i] + Vec3(0, 0, i % 2 == 0 ? waver : -waver);
        x = Eigen::AngleAxisd(angle, Vec3::UnitZ()) * x;
        mesh.normals[i] = (Eigen::AngleAxisd(angle, Vec3::UnitZ()) * normal).normalized();
      }
      double far = 0, whole = 0;
      for (const auto& [i, j, k] : mesh.triangles) {
        const auto& v = mesh.vertices;
        whole += (v[j] - v[i]).cross(v[k] - v[i]).norm();
      }
      for (const ShellPart& part : far_from_disturbances(model)) {
        const auto& [i, j, k] = mesh.triangles[part.shell];
        const auto& v = mesh.vertices;
        far += part.share() * (v[j] - v[i]).cross(v[k] - v[i]).norm();
      }
      EXPECT_NEAR(1 - far / whole, wanted, 0.02 * wanted) << n << ' ' << waver;
    }
  }
}

/// A wall whose thickness varies smoothly, stretched evenly: its stress is even, though shells have a mean thickness.
TEST(Fields, OfAWallOfSmoothThicknessHaveThatOfThePlace) {
  const Grid grid = make_grid(16, 4, [](double u, double v) { return Vec3(4 * u, v, 0); });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0, 1));
  auto& thickness = model.shells[0].thickness;
  thickness.clear();
  State state;
  state.linear = true;
  for (const Vec3& p : grid.mesh.vertices) {
    thickness.push_back(1 + 0.2 * p.x());
    state.displacement.emplace_back(1e-3 * p.x(), 0, 0);
    state.rotation.emplace_back(Vec3::Zero());
  }
  const ElementFields fields = element_fields(model, state);
  for (const double stress : fields.von_mises) {
    EXPECT_NEAR(stress, 1, 0.015);
  }
  EXPECT_NEAR(fields.wall.whole.stress_max, 1, 0.015);
}

/// A patch test: an uneven strip that is pulled at its end bears the same everywhere, whatever its membrane.
TEST(Fields, AStripThatIsPulledAtItsEndBearsTheSameEverywhere) {
  const Grid grid = make_grid(10, 3, [](double u, double v) { return Vec3(10 * u, v, 0); });
  for (const Membrane membrane : {Membrane::cst, Membrane::opt, Membrane::adapt}) {
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 1000, 0, 0.1));
    model.shells[0].membrane = membrane;
    hold(
        model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
    EdgeLoad edge;
    edge.per_length = Vec3(1, 0, 0);
    for (std::size_t j = 0; j < 3; ++j) {
      edge.edges.push_back({grid.node(10, j), grid.node(10, j + 1)});
    }
    model.loads.push_back({0, edge, {}});
    for (const double stress : element_fields(model, last_state(model, linear_run())).membrane_von_mises) {
      EXPECT_NEAR(stress, 10, 1e-6);
    }
  }
}

/// A plate that is pulled, twice as thick from its middle on: equilibrium hands the force on, and the stress is that
/// over the thickness of the place, without waves of the step.
TEST(Fields, AreNotDisturbedByAStepOfTheThickness) {
  const Grid grid = make_grid(16, 4, [](double u, double v) { return Vec3(4 * u, v, 0); });
  constexpr double force = 2;
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 1000, 0, 1));
  auto& thickness = model.shells[0].thickness;
  thickness.clear();
  EdgeLoad edge;
  edge.per_length = Vec3(force, 0, 0);
  for (std::size_t j = 0; j < 4; ++j) {
    edge.edges.push_back({grid.node(16, j), grid.node(16, j + 1)});
  }
  for (const Vec3& p : grid.mesh.vertices) {
    thickness.push_back(p.x() < 2 - eps ? 1 : 2);
  }
  model.loads.push_back({0, edge, {}});
  hold(
      model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
  hold(
      model, [](const Vec3&) { return true; }, "yz", "xyz");
  const ElementFields fields = element_fields(model, last_state(model, linear_run()));
  for (std::size_t i = 0; i < thickness.size(); ++i) {
    if (std::abs(grid.mesh.vertices[i].x() - 1.875) > 0.2) {  // of no shell that stands for the step
      const double exact = force / thickness[i];
      EXPECT_NEAR(fields.von_mises[i], exact, 0.015 * exact);
    }
  }
}

}  // namespace
}  // namespace tunica
