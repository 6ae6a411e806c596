// How many flat triangles a fitted shell replaces, on shapes that nothing was made for, and what the fit keeps.
#include "shell/families.hpp"
#include "shell/fit.hpp"
#include "shell/fit_cross.hpp"
#include "surface/checks.hpp"
#include "surface/closest_point.hpp"
#include "surface/decimate.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace tunica {
namespace {

constexpr double effort = 0.2;  // bars are cleared with much less than the usual

constexpr double full_turn = 2 * 3.14159265358979323846;

/// A grid around (closed) and along (closed or open) of point(angle, share along).
TriangleMesh tube(int around, int along, bool closed, const std::function<Vec3(double, double)>& point) {
  TriangleMesh mesh;
  const int rows = closed ? along : along + 1;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < around; ++i) {
      mesh.vertices.push_back(point(full_turn * i / around, static_cast<double>(j) / along));
    }
  }
  const auto at = [&](int j, int i) { return static_cast<Index>((j % rows) * around + i % around); };
  for (int j = 0; j < along; ++j) {
    for (int i = 0; i < around; ++i) {
      mesh.triangles.push_back({at(j, i), at(j, i + 1), at(j + 1, i + 1)});
      mesh.triangles.push_back({at(j, i), at(j + 1, i + 1), at(j + 1, i)});
    }
  }
  return mesh;
}

/// Half a ring of changing width, open at both ends.
TriangleMesh half_torus(int around, int along) {
  return tube(around, along, false, [](double a, double s) {
    const double b = full_turn / 2 * s, r = 9 + 1.5 * std::sin(5 * b) * std::cos(a);
    return Vec3((30 + r * std::cos(a)) * std::cos(b), (30 + r * std::cos(a)) * std::sin(b), r * std::sin(a));
  });
}

/// Two lobes of different sizes and a neck.
TriangleMesh dumbbell(int times) {
  TriangleMesh mesh = testing::sphere(times);
  for (Vec3& p : mesh.vertices) {
    const double x = p.x();
    const double r = 16 + 34 * x * x + 7 * x * x * x + 2 * std::sin(3 * p.y() + 2 * p.z());
    p = r * Vec3(1.3 * x, p.y(), 0.9 * p.z());
  }
  return mesh;
}

/// @param angle  degrees: asked for; none: as the fit sees fit, at least `least`
RelaxResult fitted(const Target& target, double percent, Patch surface = Patch::comas, std::optional<double> angle = {},
                   double least = 20) {
  RelaxOptions options;
  options.min_angle = angle;
  options.method = RelaxMethod::fit;
  options.surface = surface;
  options.tolerance = percent / 100 * target.diagonal();
  options.effort = effort;
  RelaxResult result = relax(target.mesh(), target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, *options.tolerance);
  EXPECT_EQ(crossing_shells(result.shell).size(), 0U);
  EXPECT_GE(min_angle_degrees(flat_facets(result.shell)), angle.value_or(least));
  return result;
}

std::size_t flat_triangles(const Target& target, double percent) {
  DecimateOptions options;
  options.max_error = percent / 100 * target.diagonal();
  return decimate(target.mesh(), options).mesh.triangles.size();
}

using Curve = std::vector<std::array<Vec3, 2>>;  ///< straight pieces

Curve boundary_of(const TriangleMesh& mesh) {
  Curve curve;
  for (const auto& loop : boundary_loops(mesh)) {
    for (std::size_t i = 0; i < loop.size(); ++i) {
      curve.push_back({mesh.vertices[loop[i]], mesh.vertices[loop[(i + 1) % loop.size()]]});
    }
  }
  return curve;
}

/// The edges of the patches at the boundary.
Curve curved_boundary_of(const ShellMesh& shell) {
  constexpr int pieces = 16;
  const std::array<Vec2, 3> corner{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  const TriangleMesh facets = flat_facets(shell);
  const auto across = neighbours(facets, incidence(facets));
  Curve curve;
  for (std::size_t t = 0; t < across.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (across[t][k] != no_neighbour) {
        continue;
      }
      const auto& v = shell.triangles[t];
      const CubicPatch patch =
          smooth_patch(shell.patch, {shell.vertices[v[0]], shell.vertices[v[1]], shell.vertices[v[2]]},
                       {shell.normal(t, 0), shell.normal(t, 1), shell.normal(t, 2)});
      const auto at = [&](int i) {
        const double s = static_cast<double>(i) / pieces;
        return patch.point((1 - s) * corner[k] + s * corner[(k + 1) % 3]);
      };
      for (int i = 0; i < pieces; ++i) {
        curve.push_back({at(i), at(i + 1)});
      }
    }
  }
  return curve;
}

/// Largest distance of one curve from the other.
double apart(const Curve& from, const Curve& to) {
  TriangleMesh thin;  // triangles without height
  for (const auto& [a, b] : to) {
    const auto first = static_cast<Index>(thin.vertices.size());
    thin.vertices.insert(thin.vertices.end(), {a, b});
    thin.triangles.push_back({first, first + 1, first + 1});
  }
  const ClosestPoint tree(thin);
  double largest = 0;
  for (const auto& [a, b] : from) {
    for (const Vec3& p : {a, Vec3((a + b) / 2)}) {
      largest = std::max(largest, (tree.closest(p).point - p).norm());
    }
  }
  return largest;
}

TEST(FitBars, OpenHalfTorus) {
  const Target target(half_torus(80, 120));
  for (const auto& [percent, factor] : {std::pair(0.5, 2.5), std::pair(0.1, 7.0)}) {
    const RelaxResult result = fitted(target, percent);
    EXPECT_LE(factor * static_cast<double>(result.shell.triangles.size()),
              static_cast<double>(flat_triangles(target, percent)))
        << result.shell.triangles.size();
    // The ends lie on the target's ends.
    const double tolerance = percent / 100 * target.diagonal();
    const Curve ends = curved_boundary_of(result.shell), wanted = boundary_of(target.mesh());
    EXPECT_EQ(examine(flat_facets(result.shell)).boundary_loops, 2U);
    EXPECT_LE(apart(ends, wanted), tolerance);
    EXPECT_LE(apart(wanted, ends), tolerance);
  }
}

TEST(FitBars, AJaggedHoleIsMetAsACurve) {
  TriangleMesh mesh = testing::cylinder(120, 100, 10, 40);
  std::erase_if(mesh.triangles, [&](const auto& v) {
    const Vec3 middle = (mesh.vertices[v[0]] + mesh.vertices[v[1]] + mesh.vertices[v[2]]) / 3;
    return middle.x() > 0 && std::hypot(middle.y(), middle.z() - 20) < 4;
  });
  const Target target(mesh);  // the vertices in the hole belong to no triangle
  ASSERT_EQ(target.boundary().size(), 3U);
  const RelaxResult result = fitted(target, 0.5, Patch::comas, {}, 2);
  const double tolerance = 0.005 * target.diagonal();
  const Curve ends = curved_boundary_of(result.shell), wanted = boundary_of(target.mesh());
  EXPECT_LE(apart(ends, wanted), tolerance);
  EXPECT_LE(apart(wanted, ends), tolerance);
  ASSERT_TRUE(result.distance.boundary);
  EXPECT_LE(result.distance.boundary->upper, tolerance);
  EXPECT_GE(result.distance.boundary->upper, 0.999 * apart(wanted, ends));
  EXPECT_LT(result.shell.triangles.size(), 40U);
}

TEST(FitBars, DumbbellAtHalfAPercent) {
  const Target target(dumbbell(5));
  const RelaxResult result = fitted(target, 0.5);
  EXPECT_LE(2.5 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.5)))
      << result.shell.triangles.size();
}

TEST(FitBars, DumbbellAtATenthOfAPercent) {
  const Target target(dumbbell(5));
  const RelaxResult result = fitted(target, 0.1);
  EXPECT_LE(7 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.1)))
      << result.shell.triangles.size();
}

TEST(FitBars, LongShellsServeAlongACylinder) {
  const Target target(testing::cylinder(160, 60, 20, 80));
  for (const Patch surface : {Patch::comas, Patch::watertight}) {
    const RelaxResult result = fitted(target, 0.1, surface, {}, 5);
    EXPECT_LE(7 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.1)))
        << result.shell.triangles.size();
  }
}

TEST(FitBars, WhereEitherPatchWillDoTheOneWithFewerLongShellsIsTaken) {
  const Target cylinder(testing::cylinder(160, 60, 20, 80));
  RelaxOptions options;
  options.method = RelaxMethod::fit;
  options.tolerance = 0.001 * cylinder.diagonal();
  options.effort = effort;
  const RelaxResult comas = relax(cylinder.mesh(), cylinder, options);
  options.either_surface = true;
  const RelaxResult either = relax(cylinder.mesh(), cylinder, options);
  EXPECT_EQ(comas.shell.patch, Patch::comas);
  EXPECT_EQ(either.shell.patch, Patch::watertight);
  EXPECT_LT(either.shell.triangles.size(), comas.shell.triangles.size());
  EXPECT_EQ(either.reached, true);
  // In several pieces all are of one patch.
  TriangleMesh two = testing::cylinder(80, 30, 20, 80);
  const TriangleMesh one = two;
  for (const Vec3& p : one.vertices) {
    two.vertices.emplace_back(p + Vec3(100, 0, 0));
  }
  for (const auto& [a, b, c] : one.triangles) {
    const auto first = static_cast<Index>(one.vertices.size());
    two.triangles.push_back({a + first, b + first, c + first});
  }
  const Target pieces(two);
  options.tolerance = 0.003 * pieces.diagonal();
  const RelaxResult both = relax(two, pieces, options);
  EXPECT_EQ(both.shell.patch, Patch::comas);
  EXPECT_EQ(both.reached, true);
}

TEST(FitBars, AnglesAskedForAreKeptWhereLongShellsWouldBeFewer) {
  const Target target(testing::cylinder(80, 30, 20, 80));
  const std::size_t any = fitted(target, 0.3, Patch::comas, {}, 5).shell.triangles.size();
  const std::size_t good = fitted(target, 0.3, Patch::comas, 20).shell.triangles.size();
  EXPECT_LT(any, good);
  // Ten shells for each thin one are not enough here.
  fitted(Target(testing::cylinder(24, 100, 3, 120)), 0.5, Patch::comas, 20);
}

TEST(FitBars, FineTolerancesAreReachedByFewPatches) {
  // Where patches gape and are off as well, the target above the gap is farther away than either says.
  const Target target(tube(200, 120, false, [](double a, double s) {
    const double b = full_turn / 5 * s, r = 9 + std::sin(2 * b) * std::cos(a);
    return Vec3((25 + r * std::cos(a)) * std::cos(b), (25 + r * std::cos(a)) * std::sin(b), 1.3 * r * std::sin(a));
  }));
  const RelaxResult result = fitted(target, 0.02);
  EXPECT_LE(12 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.02)))
      << result.shell.triangles.size();
}

TEST(FitBars, WatertightPatchesNeedAThirdFewer) {
  const Target target(dumbbell(5));
  const RelaxResult result = fitted(target, 0.1, Patch::watertight);
  EXPECT_LE(10 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.1)))
      << result.shell.triangles.size();
}

TEST(FitBars, HandlesAreKept) {
  const Target target(tube(60, 120, true, [](double a, double s) {
    const double b = full_turn * s, r = 8 + std::sin(3 * b);
    return Vec3((30 + r * std::cos(a)) * std::cos(b), (24 + r * std::cos(a)) * std::sin(b), r * std::sin(a));
  }));
  ASSERT_EQ(examine(target.mesh()).euler, 0);
  const RelaxResult result = fitted(target, 0.5);
  const MeshFacts facts = examine(flat_facets(result.shell));
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_TRUE(facts.closed);
  EXPECT_EQ(facts.components, 1U);
  EXPECT_EQ(facts.euler, 0) << "a handle";
  EXPECT_LE(2.5 * static_cast<double>(result.shell.triangles.size()), static_cast<double>(flat_triangles(target, 0.5)))
      << result.shell.triangles.size();
}

}  // namespace
}  // namespace tunica
