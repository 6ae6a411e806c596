// Further published problems: membranes, circular plates, pressure, large inflation.

#include "benchmarks.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

/// Rings of n, 2 n ... segments: 6 rings^2 triangles on the unit disc; the centre is node 0.
ShellMesh disc(double radius, std::size_t rings) {
  ShellMesh mesh;
  mesh.vertices.push_back(Vec3::Zero());
  const auto first = [](std::size_t ring) { return ring == 0 ? 0 : 1 + 3 * ring * (ring - 1); };
  for (std::size_t ring = 1; ring <= rings; ++ring) {
    for (std::size_t i = 0; i < 6 * ring; ++i) {
      const double angle = 2 * pi * static_cast<double>(i) / static_cast<double>(6 * ring);
      const double r = radius * static_cast<double>(ring) / static_cast<double>(rings);
      mesh.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), 0);
    }
  }
  const auto node = [&](std::size_t ring, std::size_t i) {
    return static_cast<Index>(ring == 0 ? 0 : first(ring) + i % (6 * ring));
  };
  for (std::size_t ring = 1; ring <= rings; ++ring) {
    for (std::size_t sector = 0; sector < 6; ++sector) {
      for (std::size_t i = 0; i < ring; ++i) {
        mesh.triangles.push_back({node(ring, sector * ring + i), node(ring, sector * ring + i + 1),
                                  node(ring - 1, sector * (ring - 1) + i)});
        if (i + 1 < ring) {
          mesh.triangles.push_back({node(ring - 1, sector * (ring - 1) + i), node(ring, sector * ring + i + 1),
                                    node(ring - 1, sector * (ring - 1) + i + 1)});
        }
      }
    }
  }
  return mesh;
}

Model clamped_disc(std::size_t rings, double thickness, double poisson) {
  Model model;
  model.shells.push_back(flat_body(disc(1, rings), 1e6, poisson, thickness));
  hold(
      model, [](const Vec3& p) { return p.norm() > 1 - eps; }, "xyz", "xyz");
  return model;
}

TEST(Published, CooksMembrane) {
  const auto ratio = [](std::size_t n) {
    const Grid grid = make_grid(n, n, [](double u, double v) { return Vec3(48 * u, 44 * u + v * (44 - 28 * u), 0); });
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 1, 1.0 / 3, 1));
    hold(
        model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
    hold(
        model, [](const Vec3&) { return true; }, "z", "xy");
    EdgeLoad edge{{}, Vec3(0, 1.0 / 16, 0)};
    for (std::size_t j = 0; j < n; ++j) {
      edge.edges.push_back({grid.node(n, j), grid.node(n, j + 1)});
    }
    model.loads.push_back({0, edge, {}});
    return last_state(model, linear_run()).displacement[grid.node(n, n / 2)].y() / 23.96;
  };
  EXPECT_NEAR(ratio(8), 1, 0.06);
  EXPECT_NEAR(ratio(16), 1, 0.025);
  EXPECT_NEAR(ratio(32), 1, 0.01);
}

TEST(Published, CantileverInItsPlane) {
  const auto ratio = [](std::size_t n) {
    const Grid grid = make_grid(4 * n, n, [](double u, double v) { return Vec3(48 * u, 12 * (v - 0.5), 0); });
    Model model;
    model.shells.push_back(flat_body(grid.mesh, 3e4, 0.25, 1));
    hold(
        model, [](const Vec3& p) { return p.x() < eps; }, "xyz", "xyz");
    hold(
        model, [](const Vec3&) { return true; }, "z", "xy");
    // The parabola of shear, lumped from its integral over each edge's halves.
    const auto below = [](double y) { return 40 * (0.5 + 1.5 * (y / 12) - 2 * std::pow(y / 12, 3)); };
    for (std::size_t j = 0; j <= n; ++j) {
      const double h = 12.0 / static_cast<double>(n);
      const double y = -6 + h * static_cast<double>(j);
      const double share = below(std::min(6.0, y + h / 2)) - below(std::max(-6.0, y - h / 2));
      model.loads.push_back({0, ForceLoad{{grid.node(4 * n, j)}, Vec3(0, share, 0)}, {}});
    }
    return last_state(model, linear_run()).displacement[grid.node(4 * n, n / 2)].y() / 0.35587;
  };
  EXPECT_NEAR(ratio(2), 1, 0.012);
  EXPECT_NEAR(ratio(4), 1, 0.006);
  EXPECT_NEAR(ratio(8), 1, 0.0025);
}

TEST(Published, ClampedCircle) {
  const auto error = [](std::size_t rings) {
    Model model = clamped_disc(rings, 0.01, 0.3);
    model.loads.push_back({0, AreaLoad{Vec3(0, 0, 1e-6)}, {}});
    const double w0 = 1e-6 / (64 * 1e6 * 1e-6 / (12 * 0.91));
    return last_state(model, linear_run()).displacement[0].z() / w0 - 1;
  };
  const double e4 = error(4), e8 = error(8), e16 = error(16);
  EXPECT_LT(std::abs(e8), 0.005);
  EXPECT_NEAR(std::log2(e4 / e8), 2, 0.3);
  EXPECT_NEAR(std::log2(e8 / e16), 2, 0.3);
}

TEST(Published, VonKarmansPlate) {
  // Immovable edge, Poisson's ratio 0.3: Q = p a^4 / (E t^4) against w0 / t. The second plate is almost a membrane.
  // On 1,536 and 6,144 triangles, of facets too, the largest deflections come to 1.25 % below the table's.
  const std::map<double, double> deflections{{1, .169},   {2, .325},   {5, .685},   {10, 1.062},
                                             {15, 1.315}, {30, 1.806}, {100, 2.892}};
  for (const double t : {0.01, 0.001}) {
    for (const bool follower : {true, false}) {
      for (const auto& [q, w] : deflections) {
        Model model = clamped_disc(8, t, 0.3);
        const double p = q * 1e6 * t * t * t * t;
        if (follower) {
          model.loads.push_back({0, PressureLoad{p, true}, {}});
        } else {
          model.loads.push_back({0, AreaLoad{Vec3(0, 0, p)}, {}});
        }
        const State state = last_state(model, nonlinear_run({1}));
        EXPECT_NEAR(state.displacement[0].z() / t, w, 0.014 * w) << t << ' ' << q;
        EXPECT_LE(state.newton_iterations, 20U);
      }
    }
  }
}

double mean_radial_displacement(const Model& model, const State& state) {
  double mean = 0;
  for (std::size_t i = 0; i < state.displacement.size(); ++i) {
    mean += state.displacement[i].dot(model.shells[0].mesh.normals[i]);
  }
  return mean / static_cast<double>(state.displacement.size());
}

TEST(Published, SphereUnderSmallPressure) {
  // w = p R^2 (1 - nu) / (2 E t), at every node: the icosahedron's twelve have five neighbours, the others six.
  for (const double thickness : {0.5, 0.1}) {
    const double w = 1e-4 * 100 * 0.7 / (2 * 1000 * thickness);
    const auto errors = [&](int level) {
      const Model model = pressurised_sphere(level, thickness, 1e-4);
      const State state = last_state(model, linear_run());
      double worst = 0;
      for (std::size_t i = 0; i < state.displacement.size(); ++i) {
        worst = std::max(worst, std::abs(state.displacement[i].dot(model.shells[0].mesh.normals[i]) / w - 1));
      }
      return std::pair(std::abs(mean_radial_displacement(model, state) / w - 1), worst);
    };
    const auto [mean_2, worst_2] = errors(2);
    const auto [mean_3, worst_3] = errors(3);
    const auto [mean_4, worst_4] = errors(4);
    EXPECT_LT(mean_2, 0.003);
    EXPECT_LT(mean_3, 0.0002);
    EXPECT_LT(mean_4, 0.00001);
    EXPECT_LT(worst_2, 0.025);
    EXPECT_LT(worst_3, 0.003);
    EXPECT_LT(worst_4, 0.0008);
    EXPECT_GT(std::log2(mean_2 / mean_3), 3.5);
    EXPECT_GT(std::log2(worst_3 / worst_4), 1.8);
  }
}

TEST(Published, SphereInflatedByHalfItsRadius) {
  // Linear co-rotational material: p = 2 E t / ((1 - nu) R) e / (1 + e)^2.
  const double e = 0.5;
  const Model model = pressurised_sphere(3, 0.1, 2 * 1000 * 0.1 / (0.7 * 10) * e / ((1 + e) * (1 + e)));
  const State state = last_state(model, nonlinear_run({0.25, 0.5, 0.75, 1}));
  EXPECT_NEAR(mean_radial_displacement(model, state) / 10, e, 0.001 * e);
}

class Hemisphere : public testing::TestWithParam<Rest> {};
INSTANTIATE_TEST_SUITE_P(Published, Hemisphere, testing::Values(Rest::flat, Rest::curved),
                         [](const auto& p) { return p.param == Rest::flat ? "Flat" : "Curved"; });

TEST_P(Hemisphere, WithLargeDisplacements) {
  constexpr std::size_t n = 8;
  const Grid grid = make_grid(n, n, [](double u, double v) {
    const double latitude = 72 * pi / 180 * v;
    const double longitude = pi / 2 * u;
    return Vec3(10 * std::cos(latitude) * std::cos(longitude), 10 * std::cos(latitude) * std::sin(longitude),
                10 * std::sin(latitude));
  });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 6.825e7, 0.3, 0.04));
  if (GetParam() == Rest::curved) {
    model.shells[0].curved = true;
    model.shells[0].rest = Rest::curved;
    for (const Vec3& vertex : grid.mesh.vertices) {
      model.shells[0].mesh.normals.push_back(vertex.normalized());
    }
  }
  hold(
      model, [](const Vec3& p) { return std::abs(p.y()) < eps; }, "y", "xz");
  hold(
      model, [](const Vec3& p) { return std::abs(p.x()) < eps; }, "x", "yz");
  model.fixes.push_back({0, {grid.node(0, 0)}, {false, false, true}, {false, false, false}, Vec3::Zero(), {}});
  model.loads.push_back({0, ForceLoad{{grid.node(0, 0)}, Vec3(200, 0, 0)}, {}});
  model.loads.push_back({0, ForceLoad{{grid.node(n, 0)}, Vec3(0, -200, 0)}, {}});
  const std::map<double, std::pair<double, double>> reference{
      {.1, {1.499, 1.840}}, {.4, {3.158, 5.196}}, {.8, {3.875, 7.448}}, {1, {4.067, 8.178}}};
  std::size_t seen = 0;
  solve(model, nonlinear_run({.1, .4, .8, 1}), [&](const State& state) {
    const auto place = reference.find(state.time);
    if (place != reference.end()) {
      const auto [outward, inward] = place->second;
      EXPECT_NEAR(state.displacement[grid.node(0, 0)].x(), outward, 0.04 * outward);
      EXPECT_NEAR(-state.displacement[grid.node(n, 0)].y(), inward, 0.04 * inward);
      ++seen;
    }
  });
  EXPECT_EQ(seen, reference.size());
}

TEST(Published, SlitAnnularPlate) {
  constexpr std::size_t across = 10, around = 80;
  const Grid grid = make_grid(across, around, [](double u, double v) {
    const double r = 6 + 4 * u;
    return Vec3(r * std::cos(2 * pi * v), r * std::sin(2 * pi * v), 0);
  });
  Model model;
  model.shells.push_back(flat_body(grid.mesh, 21e6, 0, 0.03));
  Fix fix;
  EdgeLoad edge{{}, Vec3(0, 0, 0.8)};
  for (std::size_t i = 0; i <= across; ++i) {
    fix.nodes.push_back(grid.node(i, around));
    if (i < across) {
      edge.edges.push_back({grid.node(i, 0), grid.node(i + 1, 0)});
    }
  }
  model.fixes.push_back(fix);
  model.loads.push_back({0, edge, {}});
  const std::map<double, std::pair<double, double>> reference{{.1, {4.277, 5.876}},   {.2, {6.725, 9.160}},
                                                              {.4, {9.529, 12.661}},  {.6, {11.257, 14.674}},
                                                              {.8, {12.642, 16.202}}, {1, {13.891, 17.528}}};
  std::size_t seen = 0;
  solve(model, nonlinear_run({.1, .2, .4, .6, .8, 1}), [&](const State& state) {
    const auto place = reference.find(state.time);
    if (place != reference.end()) {
      const auto [inner, outer] = place->second;
      EXPECT_NEAR(state.displacement[grid.node(0, 0)].z(), inner, 0.03 * inner);
      EXPECT_NEAR(state.displacement[grid.node(across, 0)].z(), outer, 0.03 * outer);
      ++seen;
    }
  });
  EXPECT_EQ(seen, reference.size());
}

}  // namespace
}  // namespace tunica
