// The shell's curvature in its membrane strain and under pressure: against flat facets, and against exact solutions.

#include "benchmarks.hpp"
#include "tunica/mechanics/runs/fields.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

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

/// Normals per corner where the surface is smooth say nothing new; at a crease each side curves by itself, and the
/// rotations of the nodes stay shared.
TEST(CurvedShell, NormalsPerCornerChangeNothingWhereTheSurfaceIsSmooth) {
  const auto solved = [](bool per_corner, Patch patch) {
    Model model;
    ShellBody body = flat_body(bumpy_organ(6), 1, 0.3, 0.2);
    body.curved = true;
    body.rest = Rest::curved;
    body.mesh.patch = patch;
    for (std::size_t t = 0; per_corner && t < body.mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = body.mesh.triangles[t];
      body.mesh.corner_normals.push_back({body.mesh.normals[a], body.mesh.normals[b], body.mesh.normals[c]});
    }
    model.shells.push_back(body);
    model.rigid_motions.push_back({0});
    model.loads.push_back({0, PressureLoad{1e-3, true}, {}});
    return last_state(model, nonlinear_run({1}));
  };
  const State shared = solved(false, Patch::comas);
  for (const State& other : {solved(true, Patch::comas), solved(true, Patch::watertight)}) {
    double largest = 0, difference = 0;
    for (std::size_t i = 0; i < shared.displacement.size(); ++i) {
      largest = std::max(largest, shared.displacement[i].norm());
      difference = std::max(difference, (shared.displacement[i] - other.displacement[i]).norm());
    }
    EXPECT_GT(largest, 1e-3);
    EXPECT_LT(difference, 1e-9 * largest);
  }
}

TEST(CurvedShell, AFoldWithNormalsPerCornerIsAsStiffAsOneOfFlatFacets) {
  // Two square plates that meet at a right angle, one clamped at its far edge, the other pulled at its own.
  constexpr std::size_t n = 8;
  const Grid grid = make_grid(
      2 * n, n, [](double u, double v) { return u < 0.5 ? Vec3(2 * u - 1, v, 0) : Vec3(0, v, 1 - 2 * u); },
      Diagonals::alternating);
  const auto sag = [&](bool curved) {
    Model model;
    ShellBody body = flat_body(grid.mesh, 1000, 0.3, 0.02);
    body.mesh.normals.assign(body.mesh.vertices.size(), Vec3(1, 0, 1).normalized());
    body.mesh.corner_normals.clear();
    body.curved = curved;
    body.rest = curved ? Rest::curved : Rest::flat;
    for (const auto& v : body.mesh.triangles) {
      const Vec3& a = body.mesh.vertices[v[0]];
      const Vec3 normal = (body.mesh.vertices[v[1]] - a).cross(body.mesh.vertices[v[2]] - a).normalized();
      body.mesh.corner_normals.push_back({normal, normal, normal});
    }
    model.shells.push_back(body);
    Fix clamped;
    ForceLoad pull;
    for (std::size_t j = 0; j <= n; ++j) {
      clamped.nodes.push_back(grid.node(0, j));
      pull.nodes.push_back(grid.node(2 * n, j));
    }
    pull.total = Vec3(1e-5, 0, 0);
    model.fixes.push_back(clamped);
    model.loads.push_back({0, pull, {}});
    return last_state(model, linear_run()).displacement[grid.node(2 * n, n / 2)].x();
  };
  const double flat = sag(false);
  EXPECT_GT(flat, 0);
  EXPECT_NEAR(sag(true), flat, 1e-3 * flat);  // the corners of curved elements drill about another axis
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
