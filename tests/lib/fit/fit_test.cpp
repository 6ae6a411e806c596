// What the fit promises, on families of surfaces with known answers: certificates, topology, shape, one normal per
// node, fewer shells than flat triangles.
#include "tunica/fit/fit.hpp"

#include "shell/families.hpp"
#include "surface/shapes.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/curved_hausdorff.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/shell/distance/shell_quality.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

/// A ball with waves: smooth, closed, of both signs of curvature.
TriangleMesh wavy(int times) {
  TriangleMesh mesh = testing::sphere(times);
  for (Vec3& p : mesh.vertices) {
    p *= 40 * (1 + 0.1 * std::sin(4 * p.x() + 1) * std::cos(3 * p.y()) + 0.05 * std::sin(5 * p.z()));
  }
  return mesh;
}

/// An open tube whose radius bulges.
TriangleMesh bulging_tube() {
  TriangleMesh mesh = testing::cylinder(64, 80, 1, 60);
  for (Vec3& p : mesh.vertices) {
    const double radius = 8 + 5 * std::exp(-std::pow((p.z() - 30) / 10, 2));
    p.x() *= radius;
    p.y() *= radius;
  }
  return mesh;
}

/// A cylinder closed by two flat discs: two creases.
TriangleMesh capped_cylinder(int around = 64, int along = 32, int rings = 8) {
  TriangleMesh mesh = testing::cylinder(around, along, 20, 60);
  for (const bool top : {false, true}) {
    const auto n = static_cast<Index>(around);
    auto outer = static_cast<Index>(top ? along * around : 0);
    const double z = top ? 60 : 0;
    const double turn = top && along % 2 == 1 ? 0.5 : 0;
    for (int ring = rings - 1; ring > 0; --ring) {
      const auto inner = static_cast<Index>(mesh.vertices.size());
      for (int i = 0; i < around; ++i) {
        const double phi = 2 * M_PI * (i + turn) / around;
        mesh.vertices.emplace_back(20.0 * ring / rings * std::cos(phi), 20.0 * ring / rings * std::sin(phi), z);
      }
      for (Index i = 0; i < n; ++i) {
        const Index a = outer + i, b = outer + (i + 1) % n, c = inner + i, d = inner + (i + 1) % n;
        for (auto v : {std::array{a, b, d}, std::array{a, d, c}}) {
          if (!top) {
            std::swap(v[1], v[2]);
          }
          mesh.triangles.push_back(v);
        }
      }
      outer = inner;
    }
    const auto middle = static_cast<Index>(mesh.vertices.size());
    mesh.vertices.emplace_back(0, 0, z);
    for (Index i = 0; i < n; ++i) {
      std::array v{outer + i, outer + (i + 1) % n, middle};
      if (!top) {
        std::swap(v[0], v[1]);
      }
      mesh.triangles.push_back(v);
    }
  }
  return mesh;
}

RelaxResult fit_to(const TriangleMesh& mesh, double percent, Patch patch = Patch::watertight) {
  const Target target(mesh);
  FitOptions options;
  options.surface = patch;
  options.tolerance = percent / 100 * target.diagonal();
  return fit(mesh, target, options);
}

/// Flat triangles within the same certified distance.
std::size_t flat_triangles(const TriangleMesh& mesh, double percent) {
  DecimateOptions options;
  options.max_error = percent / 100 * diagonal(mesh);
  return decimate(mesh, options).mesh.triangles.size();
}

/// Everything that every fit to a tolerance keeps, and that its shells are so many times fewer than flat triangles.
void expect_promises(const RelaxResult& result, const TriangleMesh& mesh, double percent, std::size_t fewer = 3) {
  const Target target(mesh);
  const double tolerance = percent / 100 * target.diagonal();
  EXPECT_EQ(result.reached, true) << result.stopped;
  EXPECT_LE(result.distance.both.upper, tolerance);
  ShellDistanceOptions measuring;
  measuring.width = tolerance / 50;
  EXPECT_LE(curved_hausdorff(result.shell, target, measuring).both.lower, tolerance);
  EXPECT_LE(fewer * result.shell.triangles.size(), flat_triangles(mesh, percent));
  const MeshFacts facts = examine(flat_facets(result.shell)), wanted = examine(mesh);
  EXPECT_TRUE(facts.manifold && facts.oriented);
  EXPECT_EQ(facts.euler, wanted.euler);
  EXPECT_EQ(facts.components, wanted.components);
  EXPECT_EQ(facts.boundary_loops, wanted.boundary_loops);
  EXPECT_GE(min_angle_degrees(flat_facets(result.shell)), FitOptions{}.min_angle);
  const ShellQuality quality = shell_quality(result.shell, target);
  EXPECT_LE(quality.size_ratio, 3);
  EXPECT_LE(quality.mean_distance, tolerance / 2);
  EXPECT_TRUE(crossing_patches(result.shell).empty());
  EXPECT_NO_THROW(require_fit(result.shell, "fitted"));
}

TEST(Fit, AClosedSmoothSurfaceByAThirdOfTheFlatTriangles) {
  const TriangleMesh mesh = wavy(5);
  const RelaxResult result = fit_to(mesh, 0.3);
  expect_promises(result, mesh, 0.3);
  EXPECT_TRUE(result.shell.corner_normals.empty());
}

TEST(Fit, AnOpenTubeKeepsItsRimsAsCurves) {
  const TriangleMesh mesh = bulging_tube();
  const RelaxResult result = fit_to(mesh, 0.3);
  expect_promises(result, mesh, 0.3);
  ASSERT_TRUE(result.distance.boundary.has_value());
  EXPECT_LE(result.distance.boundary->upper, 0.003 * diagonal(mesh));
  EXPECT_TRUE(result.shell.corner_normals.empty());
}

TEST(Fit, ThePapersPatchTakesMoreShellsAndHoldsTheSame) {
  const TriangleMesh mesh = bulging_tube();
  const RelaxResult result = fit_to(mesh, 0.5, Patch::comas);
  expect_promises(result, mesh, 0.5, 2);
  EXPECT_GE(result.shell.triangles.size(), fit_to(mesh, 0.5).shell.triangles.size());
}

TEST(Fit, CreasesOfTheTargetHaveANormalForEachSideAndLidsHaveNodesOfTheirOwn) {
  const TriangleMesh mesh = capped_cylinder(48, 24, 6);
  const RelaxResult result = fit_to(mesh, 0.2);
  expect_promises(result, mesh, 0.2);
  ASSERT_FALSE(result.shell.corner_normals.empty());
  std::vector<double> parted(result.shell.vertices.size(), 0);
  for (std::size_t t = 0; t < result.shell.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index v = result.shell.triangles[t][k];
      parted[v] = std::max(parted[v], (result.shell.corner_normals[t][k] - result.shell.normals[v]).norm());
    }
  }
  for (std::size_t v = 0; v < parted.size(); ++v) {
    const Vec3& p = result.shell.vertices[v];
    const bool on_rim = std::hypot(p.x(), p.y()) > 19.5 && std::min(p.z(), 60 - p.z()) < 0.5;
    EXPECT_EQ(parted[v] > 0.1, on_rim) << p.transpose();
  }
  // At this tolerance a rim has more nodes than good shells can join without one inside the lid.
  for (const double z : {0.0, 60.0}) {
    EXPECT_TRUE(std::ranges::any_of(result.shell.vertices, [&](const Vec3& p) {
      return std::abs(p.z() - z) < 0.5 && std::hypot(p.x(), p.y()) < 15;
    })) << z;
  }
}

TEST(Fit, AHandleIsKept) {
  const TriangleMesh mesh = shapes::torus(96, 48, 30, 10);
  expect_promises(fit_to(mesh, 0.5), mesh, 0.5);
}

TEST(Fit, CertificatesFindWhatSamplesMiss) {
  // A bump of one vertex, between the points that are sampled on some hundred shells.
  TriangleMesh mesh = wavy(6);
  Vec3& p = mesh.vertices[12345];
  p *= 1.02;
  const RelaxResult result = fit_to(mesh, 0.5);
  EXPECT_EQ(result.reached, true);
  const Target target(mesh);
  ShellDistanceOptions measuring;
  measuring.width = 1e-4 * target.diagonal();
  EXPECT_LE(curved_hausdorff(result.shell, target, measuring).both.upper, 0.0051 * target.diagonal());
}

TEST(Fit, ACountIsKeptAndMoreShellsAreCloser) {
  const TriangleMesh mesh = wavy(5);
  const Target target(mesh);
  double last = std::numeric_limits<double>::infinity();
  for (const std::size_t shells : {60u, 120u, 240u}) {
    FitOptions options;
    options.shells = shells;
    const RelaxResult result = fit(mesh, target, options);
    EXPECT_LE(result.shell.triangles.size(), shells);
    EXPECT_GE(result.shell.triangles.size(), shells * 9 / 10);
    EXPECT_LT(result.distance.both.upper, last / 2);
    last = result.distance.both.upper;
  }
}

/// A ball with fins thinner than the shells that are asked for: no normal agrees with both walls of a fin.
TriangleMesh finned() {
  TriangleMesh mesh = testing::sphere(4);
  for (Vec3& p : mesh.vertices) {
    p *= 40 * (1 + 0.8 * std::pow(std::abs(std::cos(2.5 * std::atan2(p.y(), p.x()))), 24) * (1 - p.z() * p.z()));
  }
  return mesh;
}

TEST(Fit, WhatFoldsBecomesShellsAllTheSame) {
  TriangleMesh disc = testing::sphere(4, 40);
  for (Vec3& p : disc.vertices) {
    p.z() *= 0.02;
  }
  for (const TriangleMesh& mesh : {disc, finned()}) {
    const Target target(mesh);
    FitOptions options;
    options.shells = 200;
    options.min_angle = 5;
    options.max_iterations = 1;
    const RelaxResult result = fit(mesh, target, options);
    EXPECT_NO_THROW(require_fit(result.shell, "fitted"));
    EXPECT_LE(result.shell.triangles.size(), 200u);
  }
}

TEST(Fit, RefiningKeepsCoarseAndSplitsWhereTheErrorIs) {
  const TriangleMesh mesh = wavy(5);
  const Target target(mesh);
  DecimateOptions decimating;
  decimating.triangles = 100;
  FitOptions options;
  options.refine = true;
  options.tolerance = 0.003 * target.diagonal();
  const RelaxResult result = fit(decimate(mesh, decimating).mesh, target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_GE(result.shell.triangles.size(), 100u);
  EXPECT_LT(result.shell.triangles.size(), 4 * 100u);
}

TEST(Fit, SaysWhenTheToleranceNeedsMoreShellsThanAllowed) {
  const TriangleMesh mesh = wavy(5);
  const Target target(mesh);
  FitOptions options;
  options.refine = true;
  options.tolerance = 0.0005 * target.diagonal();
  options.max_shells = 60;
  const RelaxResult result = fit(testing::sphere(0, 40), target, options);
  EXPECT_EQ(result.reached, false);
  EXPECT_LE(result.shell.triangles.size(), 60u);
}

TEST(Fit, ACountLimitsLevelsToo) {
  const TriangleMesh mesh = wavy(5);
  const Target target(mesh);
  FitOptions options;
  options.refine = true;
  options.max_iterations = 3;
  options.shells = 90;
  EXPECT_EQ(fit(testing::sphere(0, 40), target, options).shell.triangles.size(), 80u);
}

TEST(Fit, TheResultDoesNotDependOnTheNumberOfThreads) {
  const TriangleMesh mesh = bulging_tube();
  const auto with = [&](std::size_t threads) {
    set_thread_count(threads);
    RelaxResult result = fit_to(mesh, 0.5);
    set_thread_count(default_thread_count());
    return result.shell;
  };
  const ShellMesh one = with(1), three = with(3);
  EXPECT_EQ(one.vertices, three.vertices);
  EXPECT_EQ(one.normals, three.normals);
  EXPECT_EQ(one.triangles, three.triangles);
}

TEST(Fit, LevelsOfTheHierarchyConvergeWithTheThirdPower) {
  // A smooth surface far finer than the shells: 80, 320, then 1,280 of them, which resolve its waves.
  const TriangleMesh mesh = wavy(7);
  const Target target(mesh);
  FitOptions options;
  options.refine = true;
  options.max_iterations = 2;
  const RelaxResult result = fit(testing::sphere(1, 40), target, options);
  ASSERT_EQ(result.iterations.size(), 2u);
  EXPECT_EQ(result.iterations[1].shells, 4 * result.iterations[0].shells);
  EXPECT_LT(result.iterations[1].hausdorff.upper, result.iterations[0].hausdorff.lower / 2);
  const ShellMesh finer = refit(result.shell, target);
  EXPECT_LT(shell_quality(finer, target).mean_distance, shell_quality(result.shell, target).mean_distance / 5);
}

TEST(Fit, RefittedShellsKeepCreasesAndRims) {
  const TriangleMesh mesh = capped_cylinder();
  const Target target(mesh);
  const ShellMesh coarse = fit_to(mesh, 0.5).shell;
  const ShellMesh fine = refit(coarse, target);
  EXPECT_EQ(fine.triangles.size(), 4 * coarse.triangles.size());
  ASSERT_EQ(fine.corner_normals.size(), fine.triangles.size());
  ShellDistanceOptions measuring;
  measuring.width = 1e-5 * target.diagonal();
  EXPECT_LT(curved_hausdorff(fine, target, measuring).both.upper,
            curved_hausdorff(coarse, target, measuring).both.lower);
  EXPECT_NO_THROW(require_fit(fine, "refitted"));
}

TEST(Fit, CoarseWithAnotherTopologyIsWhatIsFitted) {
  const Target target(shapes::torus(96, 48, 30, 10));
  FitOptions options;
  const RelaxResult result = fit(testing::sphere(2, 40), target, options);
  EXPECT_EQ(examine(flat_facets(result.shell)).euler, 2);
}

}  // namespace
}  // namespace tunica
