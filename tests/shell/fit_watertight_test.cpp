// Watertight patches along creases: what the fit places is what the certificate and the file mean, and few shells do.
#include "shell/families.hpp"
#include "shell/fit.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_start.hpp"
#include "shell/gaps.hpp"
#include "surface/checks.hpp"
#include "surface/closest_point.hpp"
#include "surface/decimate.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

namespace tunica {
namespace {

constexpr double pi = 3.14159265358979323846;

/// Turns a profile (r, z), which starts and ends on the axis, about z.
TriangleMesh turned(const std::vector<Vec2>& profile, int around) {
  TriangleMesh mesh;
  for (std::size_t j = 1; j + 1 < profile.size(); ++j) {
    for (int i = 0; i < around; ++i) {
      const double a = 2 * pi * i / around;
      mesh.vertices.emplace_back(profile[j][0] * std::cos(a), profile[j][0] * std::sin(a), profile[j][1]);
    }
  }
  const auto rows = static_cast<int>(profile.size()) - 2;
  const auto at = [&](int j, int i) { return static_cast<Index>(j * around + i % around); };
  const auto bottom = static_cast<Index>(mesh.vertices.size()), top = bottom + 1;
  mesh.vertices.emplace_back(0, 0, profile.front()[1]);
  mesh.vertices.emplace_back(0, 0, profile.back()[1]);
  for (int i = 0; i < around; ++i) {
    mesh.triangles.push_back({bottom, at(0, i + 1), at(0, i)});
    mesh.triangles.push_back({top, at(rows - 1, i), at(rows - 1, i + 1)});
    for (int j = 0; j + 1 < rows; ++j) {
      mesh.triangles.push_back({at(j, i), at(j, i + 1), at(j + 1, i + 1)});
      mesh.triangles.push_back({at(j, i), at(j + 1, i + 1), at(j + 1, i)});
    }
  }
  return mesh;
}

void add_line(std::vector<Vec2>& profile, const Vec2& to, int pieces) {
  const Vec2 from = profile.back();
  for (int i = 1; i <= pieces; ++i) {
    profile.emplace_back(from + (to - from) * i / pieces);
  }
}

/// Radius 1, z from 0 to 3.
TriangleMesh closed_cylinder(int around) {
  std::vector<Vec2> profile{{0, 0}};
  add_line(profile, {1, 0}, around / 8);
  add_line(profile, {1, 3}, around / 2);
  add_line(profile, {0, 3}, around / 8);
  return turned(profile, around);
}

/// Two caps of a ball that meet at a right angle.
TriangleMesh lens(int around) {
  std::vector<Vec2> profile;
  const int n = around / 6;
  for (int i = -n; i <= n; ++i) {
    const double a = pi / 4 * (1 - std::abs(i) / static_cast<double>(n));
    profile.emplace_back(std::sin(a), (i < 0 ? -1 : 1) * (std::cos(a) - std::cos(pi / 4)));
  }
  profile.front()[0] = profile.back()[0] = 0;
  return turned(profile, around);
}

/// A box with bulging faces: at eight corners three curved creases meet.
TriangleMesh pillow(int n) {
  TriangleMesh mesh;
  std::map<std::array<int, 3>, Index> known;
  const auto at = [&](const std::array<int, 3>& p) {
    const auto [place, is_new] = known.try_emplace(p, static_cast<Index>(mesh.vertices.size()));
    if (is_new) {
      const auto unit = [&](std::size_t k) { return 2.0 * p[k] / n - 1; };
      Vec3 v;
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = unit(k), y = unit((k + 1) % 3), z = unit((k + 2) % 3);
        v[static_cast<Eigen::Index>(k)] = x * (1.2 - 0.1 * y * y - 0.1 * z * z);
      }
      mesh.vertices.push_back(v.cwiseProduct(Vec3(2, 1.5, 1)));
    }
    return place->second;
  };
  for (std::size_t k = 0; k < 3; ++k) {
    for (const int side : {0, n}) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int u, int v) {
            std::array<int, 3> p{};
            p[k] = side;
            p[(k + 1) % 3] = i + u;
            p[(k + 2) % 3] = j + v;
            return at(p);
          };
          const std::array<Index, 4> c{corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
          mesh.triangles.push_back(side == 0 ? std::array<Index, 3>{c[0], c[2], c[1]}
                                             : std::array<Index, 3>{c[0], c[1], c[2]});
          mesh.triangles.push_back(side == 0 ? std::array<Index, 3>{c[0], c[3], c[2]}
                                             : std::array<Index, 3>{c[0], c[2], c[3]});
        }
      }
    }
  }
  return mesh;
}

/// A curved sheet with a fold along x that fades out in its middle.
TriangleMesh folded_sheet(int n) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double x = 40.0 * i / n - 20, y = 40.0 * j / n - 20, s = std::clamp((8 - x) / 20, 0.0, 1.0);
      mesh.vertices.emplace_back(x, y, -0.35 * s * s * (3 - 2 * s) * std::abs(y) - (x * x + y * y) / 120);
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<Index>(j * (n + 1) + i), b = static_cast<Index>(a + static_cast<Index>(n) + 1);
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  }
  return mesh;
}

RelaxResult fitted(const Target& target, double percent) {
  RelaxOptions options;
  options.method = RelaxMethod::fit;
  options.surface = Patch::watertight;
  options.tolerance = percent / 100 * target.diagonal();
  options.effort = 0.1;  // what these tests are about it does not change
  RelaxResult result = relax(target.mesh(), target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, *options.tolerance);
  EXPECT_EQ(crossing_shells(result.shell).size(), 0U);
  EXPECT_FALSE(result.shell.corner_normals.empty());
  EXPECT_LT(testing::largest_gap(result.shell).first, 1e-15 * target.diagonal());
  return result;
}

double flat_triangles(const Target& target, double percent) {
  DecimateOptions options;
  options.max_error = percent / 100 * target.diagonal();
  return static_cast<double>(decimate(target.mesh(), options).mesh.triangles.size());
}

/// Points of the curved surface are no farther from the true one than certified (and the target from the true one).
void expect_within(const RelaxResult& result, double target_error, const std::function<double(const Vec3&)>& distance) {
  for (const Vec3& p : tessellate_uniformly(result.shell, 10).mesh.vertices) {
    ASSERT_LE(distance(p), result.distance.both.upper + target_error);
  }
}

TEST(FitWatertight, AClosedCylinderNeedsAThirdOfTheFlatTriangles) {
  const Target target(closed_cylinder(96));
  const double sagitta = 1 - std::cos(pi / 96);
  const auto distance = [](const Vec3& p) {
    const double r = std::hypot(p.x(), p.y()) - 1, beyond = std::abs(p.z() - 1.5) - 1.5;
    return r > 0 && beyond > 0 ? std::hypot(r, beyond) : std::min(std::abs(r), std::abs(beyond));
  };
  const RelaxResult coarse = fitted(target, 0.5), fine = fitted(target, 0.1);
  EXPECT_LE(2 * static_cast<double>(coarse.shell.triangles.size()), flat_triangles(target, 0.5));
  EXPECT_LE(3 * static_cast<double>(fine.shell.triangles.size()), flat_triangles(target, 0.1));
  for (const RelaxResult* result : {&coarse, &fine}) {
    expect_within(*result, sagitta, distance);
    const MeshFacts facts = examine(flat_facets(result->shell));
    EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
    EXPECT_TRUE(facts.closed);
    EXPECT_NEAR(curved_volume(result->shell), 3 * pi, 0.02 * 3 * pi);
  }
}

TEST(FitWatertight, ACurvedRimBetweenCurvedSidesIsKept) {
  const Target target(lens(96));
  const RelaxResult result = fitted(target, 0.1);
  EXPECT_LE(8 * static_cast<double>(result.shell.triangles.size()), flat_triangles(target, 0.1))
      << result.shell.triangles.size();
  expect_within(result, 2e-3, [](const Vec3& p) {
    const double h = std::sqrt(0.5), below = (p - Vec3(0, 0, h)).norm() - 1, above = (p + Vec3(0, 0, h)).norm() - 1;
    return below > 0 || above > 0 ? std::max(below, above) : std::min(-below, -above);
  });
}

TEST(FitWatertight, ThreeCreasesMeetAtACorner) {
  const Target target(pillow(32));
  const RelaxResult result = fitted(target, 0.1);
  EXPECT_LE(5 * static_cast<double>(result.shell.triangles.size()), flat_triangles(target, 0.1))
      << result.shell.triangles.size();
  // The corners themselves are met.
  const ClosestPoint curved(tessellate_uniformly(result.shell, 10).mesh);
  for (const double x : {-2.0, 2.0}) {
    EXPECT_LE(curved.closest(Vec3(x, 1.5, -1)).squared_distance, std::pow(result.distance.both.upper + 1e-9, 2));
  }
}

TEST(FitWatertight, ACreaseMayEndInsideTheSurface) {
  const Target target(folded_sheet(64));
  const RelaxResult result = fitted(target, 0.1);
  EXPECT_LE(5 * static_cast<double>(result.shell.triangles.size()), flat_triangles(target, 0.1))
      << result.shell.triangles.size();
  std::size_t creased = 0, smooth = 0;
  const auto beside = neighbours(flat_facets(result.shell), incidence(flat_facets(result.shell)));
  for (std::size_t t = 0; t < beside.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Vec3& own = result.shell.normal(t, k);
      const Vec3& mean = result.shell.normals[result.shell.triangles[t][static_cast<std::size_t>(k)]];
      (own.dot(mean) < 0.999 ? creased : smooth) += 1;
    }
  }
  EXPECT_GE(creased, 2U);
  EXPECT_GT(smooth, creased);
}

FitState creased_state(const FitSamples& samples, std::size_t triangles) {
  const FitStart start = start_of_fit(samples.target(), triangles);
  FitMesh mesh = prepare_fit(start, samples.target());
  mesh.kind = Patch::watertight;
  FitState state(samples, std::move(mesh), {});
  state.attach();
  state.measure();
  return state;
}

double difference(const CubicPatch& a, const CubicPatch& b) {
  double largest = 0;
  for (std::size_t i = 0; i < 10; ++i) {
    largest = std::max(largest, (a.control[i] - b.control[i]).norm());
  }
  return largest;
}

/// What is measured under edit, and what the file means.
void expect_one_surface(const FitState& state) {
  std::vector<Index> triangle;
  const auto patches = curved_patches(state.mesh.shell(&triangle));
  std::size_t creased = 0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    ASSERT_LT(difference(state.mesh.patch(triangle[i]), patches[i]), 1e-12) << i;
    ASSERT_LT(difference(state.shape(triangle[i]).patch(), patches[i]), 1e-12) << i;
    creased += state.mesh.creases(triangle[i]) ? 1 : 0;
  }
  EXPECT_GT(creased, 20U);
}

/// What edits leave as measured is what measuring again finds.
void expect_measured(const FitState& state) {
  FitState again = state;
  for (Index t = 0; t < again.mesh.triangles.size(); ++t) {
    if (again.mesh.is_alive(t)) {
      again.measure(t, std::numeric_limits<double>::infinity());
      ASSERT_NEAR(again.patches[t].error, state.patches[t].error, 1e-9) << t;
    }
  }
}

TEST(FitWatertight, EditsBesideCreasesMeasureWhatTheFileMeans) {
  const Target target(closed_cylinder(96));
  const FitSamples samples(target, 200);
  FitState state = creased_state(samples, 160);
  expect_one_surface(state);
  const double limit = 0.01 * target.diagonal();
  std::size_t merged = 0, split = 0, moved = 0;
  for (const auto& [u, v] : state.mesh.edges()) {
    std::vector<Index> slots;
    state.mesh.slots_of(u, slots);
    if (slots.size() < 2 || state.mesh.around[u].empty() || state.mesh.around[v].empty() ||
        state.mesh.on_edge(u, v).count() == 0) {
      continue;
    }
    if (merged < 4) {
      merged += merge_edge(state, u, v, limit) ? 1 : 0;
    } else if (split < 4) {
      split += split_edge(state, u, v, limit) ? 1 : 0;
    } else if (moved < 4) {
      moved += move_node(state, u, state.mesh.positions[u], 0, limit) ? 1 : 0;
    }
  }
  ASSERT_EQ(merged + split + moved, 12U);
  expect_measured(state);
  expect_one_surface(state);
  state.attach();
  state.measure();
  EXPECT_GT(flip_edges(state, 0.2 * state.error()), 0U);
  expect_measured(state);
  const double left = state.solve(2, 1);
  EXPECT_LT(left, 1);
  expect_measured(state);
  expect_one_surface(state);
  state.attach();
  state.measure();
  EXPECT_GT(detach_worst(state, 0.1 * state.error()) + join_normals(state, 0.5 * state.error()), 0U);
  expect_measured(state);
  expect_one_surface(state);
}

TEST(FitWatertight, APieceSeesTheNormalsBeyondItsRim) {
  const Target target(closed_cylinder(96));
  const FitSamples samples(target, 200);
  const FitState state = creased_state(samples, 160);
  std::size_t rims = 0;
  for (Index v = 0; v < state.mesh.positions.size(); v += 3) {
    const FitRegion region = cut_out(state, {v}, 0);
    rims += region.state.mesh.rim.size();
    for (Index i = 0; i < region.triangles.size(); ++i) {
      ASSERT_LT(difference(region.state.mesh.patch(i), state.mesh.patch(region.triangles[i])), 1e-12);
    }
  }
  EXPECT_GT(rims, 10U);
}

/// The derivatives by the normals across are those of the patch.
TEST(FitWatertight, EdgesFollowTheNormalsAcrossAsTheirDerivativesSay) {
  PatchShape shape{{Vec3(0, 0, 0), Vec3(2, 0.1, 0), Vec3(0.3, 1.7, 0.2)},
                   {Vec3(-0.3, 0.1, 1).normalized(), Vec3(0.3, 0.1, 1).normalized(), Vec3(0, 0.4, 1).normalized()},
                   Patch::watertight,
                   {}};
  shape.across = own_normals_across(shape.normals);
  (*shape.across)[0] = {Vec3(-0.3, -1, 0.2).normalized(), Vec3(0.2, -1, 0.1).normalized()};
  (*shape.across)[2][0] = Vec3(-0.1, 0.2, 1).normalized();
  const auto jacobian = across_jacobian(shape);
  const CubicPatch base = shape.patch();
  double largest = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      PatchShape tilted = shape;
      Vec3& normal = (*tilted.across)[i / 2][i % 2];
      const Vec3 before = normal;
      const double step = 1e-4;
      std::array<CubicPatch, 2> sides;
      for (std::size_t side = 0; side < 2; ++side) {
        normal = (before + (side == 0 ? -step : step) * tilt_axes(before)[k]).normalized();
        sides[side] = tilted.patch();
      }
      for (std::size_t j = 0; j < 10; ++j) {
        const Vec3 expected = (sides[1].control[j] - sides[0].control[j]) / (2 * step);
        const Vec3 found = jacobian.block<3, 1>(static_cast<Eigen::Index>(3 * j), static_cast<Eigen::Index>(2 * i + k));
        EXPECT_LT((found - expected).norm(), 1e-4);
        largest = std::max(largest, expected.norm());
      }
    }
  }
  EXPECT_GT(largest, 0.1);
  EXPECT_GT((base.control[3] - smooth_patch(Patch::watertight, shape.corners, shape.normals).control[3]).norm(), 0.01);
}

}  // namespace
}  // namespace tunica
