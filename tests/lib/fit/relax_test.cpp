#include "tunica/fit/relax.hpp"

#include "shell/families.hpp"
#include "tunica/core/error.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace tunica {
namespace {

/// Intervals wide enough for the tests to be quick.
RelaxOptions quick(const Target& target) {
  RelaxOptions options;
  options.width = 1e-4 * target.diagonal();
  return options;
}

TEST(Relax, SettlesAndReturnsTheBestIterate) {
  const Target target(testing::sphere(4));
  const RelaxResult result = relax_by_barycentre(testing::sphere(1, 1.1), target, quick(target));
  ASSERT_FALSE(result.iterations.empty());
  EXPECT_LT(result.iterations.size(), 20u);
  EXPECT_FALSE(result.reached.has_value());
  for (const RelaxIteration& iteration : result.iterations) {
    EXPECT_LE(result.distance.both.lower, iteration.hausdorff.upper);
    EXPECT_EQ(iteration.shells, 80u);
  }
  EXPECT_LT(result.distance.both.upper, 0.01);
  EXPECT_NO_THROW(require_fit(result.shell, "sphere"));
}

TEST(Relax, StopsAsSoonAsTheToleranceCertainlyHolds) {
  const Target target(testing::sphere(4));
  RelaxOptions options = quick(target);
  options.tolerance = 0.02 * target.diagonal();
  const RelaxResult result = relax_by_barycentre(testing::sphere(1, 1.1), target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, *options.tolerance);
  EXPECT_EQ(result.iterations.size(), 1u);
}

TEST(Relax, SaysWhenTheToleranceIsOutOfReach) {
  const Target target(testing::sphere(4));
  RelaxOptions options = quick(target);
  options.tolerance = 1e-5 * target.diagonal();
  const RelaxResult result = relax_by_barycentre(testing::sphere(0, 1.1), target, options);
  EXPECT_EQ(result.reached, false);
  EXPECT_FALSE(result.shell.triangles.empty());
}

TEST(Relax, RefinesUntilTheToleranceHolds) {
  const Target target(testing::sphere(4));
  RelaxOptions options = quick(target);
  options.refine = true;
  std::size_t shells = 0;
  for (const double percent : {1.0, 0.3}) {
    options.tolerance = percent / 100 * target.diagonal();
    const RelaxResult result = relax_by_barycentre(testing::sphere(0, 1.1), target, options);
    EXPECT_EQ(result.reached, true);
    EXPECT_LE(result.distance.both.upper, *options.tolerance);
    EXPECT_GE(result.shell.triangles.size(), shells);
    shells = result.shell.triangles.size();
    const MeshFacts facts = examine(flat_facets(result.shell));
    EXPECT_TRUE(facts.manifold && facts.oriented && facts.closed);
  }
  EXPECT_LT(shells, 400u);
}

TEST(Relax, RefinesNoFurtherThanAllowed) {
  const Target target(testing::sphere(4));
  RelaxOptions options = quick(target);
  options.refine = true;
  options.tolerance = 1e-4 * target.diagonal();
  options.max_shells = 60;
  const RelaxResult result = relax_by_barycentre(testing::sphere(0), target, options);
  EXPECT_EQ(result.reached, false);
  EXPECT_LE(result.shell.triangles.size(), 60u);
}

TEST(Relax, WithoutAToleranceEveryIterationSplitsAllShellsAsInThePaper) {
  const Target target(testing::cylinder(64, 20, 1, 3));
  RelaxOptions options = quick(target);
  options.surface = Patch::comas;
  options.refine = true;
  options.max_iterations = 2;
  const RelaxResult result = relax_by_barycentre(testing::cylinder(6, 1, 1, 3), target, options);
  ASSERT_EQ(result.iterations.size(), 2u);
  EXPECT_EQ(result.iterations[0].shells, 12u);
  EXPECT_EQ(result.iterations[1].shells, 48u);
  EXPECT_LT(result.iterations[1].hausdorff.upper, result.iterations[0].hausdorff.upper / 4);
}

TEST(Relax, OpenCylinderKeepsItsEnds) {
  const Target target(testing::cylinder(64, 40, 1, 3));
  RelaxOptions options = quick(target);
  options.refine = true;
  options.tolerance = 0.003 * target.diagonal();
  const RelaxResult result = relax_by_barycentre(testing::cylinder(6, 1, 1.05, 3), target, options);
  EXPECT_EQ(result.reached, true);
  const Box box = bounding_box(flat_facets(result.shell));
  EXPECT_NEAR(box.lower.z(), 0, 1e-12);
  EXPECT_NEAR(box.upper.z(), 3, 1e-12);
  EXPECT_EQ(examine(flat_facets(result.shell)).boundary_loops, 2u);
}

TEST(Relax, AMeshThatFacesTheOtherWayIsSeenAndTurned) {
  const Target target(testing::sphere(4));
  const TriangleMesh coarse = testing::sphere(1, 1.1);
  EXPECT_FALSE(faces_other_way(coarse, target));
  EXPECT_TRUE(faces_other_way(turned_around(coarse), target));
  EXPECT_EQ(turned_around(turned_around(coarse)).triangles, coarse.triangles);
}

TEST(Relax, UnusedNodesAreDropped) {
  const Target target(testing::sphere(4));
  TriangleMesh coarse = testing::sphere(1, 1.1);
  coarse.vertices.insert(coarse.vertices.begin(), Vec3(9, 9, 9));
  for (auto& v : coarse.triangles) {
    for (Index& i : v) {
      ++i;
    }
  }
  EXPECT_EQ(relax_by_barycentre(coarse, target, quick(target)).shell.vertices.size(), 42u);
}

TEST(Relax, ANeedleWhoseTipHasNoNormalIsMended) {
  const TriangleMesh needle{{{1, 0, 0}, {-0.5, 0.8, 0}, {-0.5, -0.8, 0}, {0, 0, 30}},
                            {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}}};
  const Target target(needle);
  const ShellMesh shell = relax_by_barycentre(needle, target, {}).shell;
  for (const auto& t : shell.triangles) {
    EXPECT_GT(normal_agreement({shell.vertices[t[0]], shell.vertices[t[1]], shell.vertices[t[2]]},
                               {shell.normals[t[0]], shell.normals[t[1]], shell.normals[t[2]]}),
              0);
  }
}

TEST(Relax, DistanceIntervalHoldsTheDenselySampledDistance) {
  const Target target(testing::sphere(4));
  const ShellMesh shell = testing::sphere_shell(0);
  ShellDistanceOptions options;
  options.width = 1e-3;
  const ShellDistance distance = shell_distance(shell, target, options);
  double sampled = 0;
  for (const Vec3& p : tessellate_uniformly(shell, 60).mesh.vertices) {
    sampled = std::max(sampled, target.closest(p).distance);
  }
  EXPECT_GE(distance.shell_to_target.upper, sampled);
  EXPECT_LE(distance.shell_to_target.lower, sampled * 1.01);
  EXPECT_LE(distance.shell_to_target.upper - distance.shell_to_target.lower, 1e-3);
  const auto errors = shell_errors(shell, target, 1e-3);
  EXPECT_EQ(errors.size(), shell.triangles.size());
  const double largest = *std::max_element(errors.begin(), errors.end());
  EXPECT_LE(largest, distance.both.upper);
  EXPECT_GE(largest, 0.9 * distance.both.lower);
}

}  // namespace
}  // namespace tunica
