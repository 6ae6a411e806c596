// The shell's curvature in its membrane strain and under pressure: against flat facets, and against exact solutions.

#include "benchmarks.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;
constexpr double eps = 1e-9;

/// A closed bumpy organ over a geodesic sphere: 20 x frequency^2 triangles with the surface's normals, mean radius 10.
ShellMesh bumpy_organ(std::size_t frequency) {
  const auto point = [](const Vec3& direction) {
    const Vec3 d = direction.normalized();
    return Vec3(
        10 * (1 + 0.12 * std::sin(3 * d.x() + 1) * std::cos(4 * d.y()) + 0.08 * std::sin(5 * d.z() + 2 * d.x())) * d);
  };
  ShellMesh mesh = make_geodesic(1, frequency);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Vec3 d = mesh.vertices[i];
    const Vec3 a = 1e-5 * d.unitOrthogonal();
    const Vec3 b = d.cross(a);
    mesh.normals[i] = (point(d + a) - point(d - a)).cross(point(d + b) - point(d - b)).normalized();
    mesh.vertices[i] = point(d);
  }
  return mesh;
}

/// Work of a small pressure on it.
double compliance(std::size_t frequency, double thickness, Membrane membrane) {
  Model model;
  ShellBody body = flat_body(bumpy_organ(frequency), 1, 0.3, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  body.membrane = membrane;
  model.shells.push_back(body);
  model.rigid_motions.push_back({0});
  model.loads.push_back({0, PressureLoad{1e-6, true}, {}});
  return last_state(model, linear_run()).strain_energy;
}

TEST(CurvedShell, BumpyOrganNeedsATenthOfTheElementsOfFlatFacets) {
  for (const double thickness : {0.1, 0.5}) {
    const double fine = compliance(32, thickness, Membrane::adapt);
    const auto error = [&](std::size_t frequency, Membrane membrane) {
      return compliance(frequency, thickness, membrane) / fine - 1;
    };
    // Flat facets tend to the same limit, with second order: the reference is not the element's own.
    const double flat_10 = error(10, Membrane::cst), flat_16 = error(16, Membrane::cst);
    EXPECT_NEAR(flat_16 + (flat_16 - flat_10) / 1.56, 0, 0.01);
    EXPECT_LT(std::abs(error(5, Membrane::adapt)), thickness < 0.3 ? 0.03 : 0.022);
    EXPECT_LT(std::abs(error(10, Membrane::adapt)), 0.01);
    EXPECT_LT(std::abs(error(16, Membrane::adapt)), 0.004);
    EXPECT_LT(error(5, Membrane::cst), thickness < 0.3 ? -0.3 : -0.1);
  }
}

TEST(CurvedShell, ClampedEndOfACylinderUnderPressure) {
  // w = w_inf (1 - exp(-bx) (cos bx + sin bx)), M = p / (2 b^2) exp(-bx) (cos bx - sin bx), six elements per 1 / b.
  const double radius = 10, thickness = 0.5, young = 1000, poisson = 0.3, pressure = 1e-3;
  const double beta = std::pow(3 * (1 - poisson * poisson), 0.25) / std::sqrt(radius * thickness);
  const double length = 6 / beta;
  constexpr std::size_t along = 36, around = 54;  // a quarter
  const Grid grid = make_grid(around, along, [&](double u, double v) {
    return Vec3(radius * std::cos(pi / 2 * u), radius * std::sin(pi / 2 * u), length * v);
  });
  Model model;
  ShellBody body = flat_body(grid.mesh, young, poisson, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  for (const Vec3& x : grid.mesh.vertices) {
    body.mesh.normals.push_back(Vec3(x.x(), x.y(), 0).normalized());
  }
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& x) { return x.z() < eps; }, "xyz", "xyz");
  hold(
      model, [](const Vec3& x) { return std::abs(x.y()) < eps; }, "y", "xz");
  hold(
      model, [](const Vec3& x) { return std::abs(x.x()) < eps; }, "x", "yz");
  hold(
      model, [&](const Vec3& x) { return x.z() > length - eps; }, "", "xy");
  model.loads.push_back({0, PressureLoad{pressure, true}, {}});
  const State state = last_state(model, linear_run());
  const double far = pressure * radius * radius / (young * thickness);
  for (std::size_t j = 0; j <= along; ++j) {
    const double x = beta * length * static_cast<double>(j) / along;
    for (const std::size_t i : {std::size_t{0}, around / 2, around}) {
      const Index node = grid.node(i, j);
      EXPECT_NEAR(state.displacement[node].dot(body.mesh.normals[node]) / far,
                  1 - std::exp(-x) * (std::cos(x) + std::sin(x)), 0.006)
          << j;
    }
  }
  // The moment along the axis, mean of a ring of cells; the element's x axis is around.
  const ElementFields fields = element_fields(model, state);
  const auto ring = [&](std::size_t j) {
    double sum = 0;
    for (std::size_t i = 0; i < around; ++i) {
      for (const std::size_t t : {2 * (i * along + j), 2 * (i * along + j) + 1}) {
        const auto& [a, b, c] = body.mesh.triangles[t];
        const Vec3 first = (body.mesh.vertices[b] - body.mesh.vertices[a]).normalized();
        const double s = first.z();  // sine of the angle between the element's x axis and the ring
        const Vec3& m = fields.bending_moment[t];
        const double r = std::sqrt(1 - s * s);
        sum += m[0] * s * s + m[1] * r * r + 2 * m[2] * s * r;
      }
    }
    return sum / (2 * static_cast<double>(around));
  };
  const double at_end = 1.5 * ring(0) - 0.5 * ring(1);
  EXPECT_NEAR(std::abs(at_end) * 2 * beta * beta / pressure, 1, 0.05);
}

}  // namespace
}  // namespace tunica
