#include "shell/fit_parts.hpp"

#include "shell/curved_surface.hpp"
#include "shell/families.hpp"
#include "shell/fit.hpp"
#include "surface/checks.hpp"
#include "surface/decimate.hpp"
#include "surface/hausdorff.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

TriangleMesh ball(int times, double radius, const Vec3& centre) {
  TriangleMesh mesh = testing::sphere(times, radius);
  for (Vec3& p : mesh.vertices) {
    p += centre;
  }
  return mesh;
}

/// An octahedron, as marching cubes make it of one voxel of these sides.
TriangleMesh voxel(const Vec3& sides, const Vec3& centre) {
  TriangleMesh mesh;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    Vec3 p = Vec3::Zero();
    p[i] = sides[i] / 2;
    mesh.vertices.emplace_back(centre + p);
    mesh.vertices.emplace_back(centre - p);
  }
  mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  return mesh;
}

RelaxOptions fitting(double tolerance) {
  RelaxOptions options;
  options.method = RelaxMethod::fit;
  options.tolerance = tolerance;
  options.effort = 0.1;  // what these tests are about it does not change
  return options;
}

TEST(FitParts, PartsAreWhatHangsTogether) {
  const std::vector<TriangleMesh> parts{ball(2, 3, Vec3::Zero()), testing::cylinder(8, 3, 1, 4),
                                        voxel(Vec3(1, 1, 5), Vec3(9, 0, 0))};
  TriangleMesh all = joined(parts);
  all.vertices.emplace_back(7, 7, 7);
  const auto found = parts_of(all, neighbours(all, incidence(all)));
  ASSERT_EQ(found.size(), parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ(found[i].triangles.size(), parts[i].triangles.size());
    EXPECT_EQ(found[i].vertices.size(), parts[i].vertices.size());
    EXPECT_NEAR(area(found[i]), area(parts[i]), 1e-12 * area(parts[i]));
    EXPECT_FALSE(why_unfit(examine(found[i])));
  }
}

TEST(FitParts, JoinedShellsKeepTheirSurfaces) {
  const std::vector<ShellMesh> parts{testing::sphere_shell(1, 2),
                                     flat_shells(voxel(Vec3(1, 1, 5), Vec3(9, 0, 0)), Patch::comas)};
  const ShellMesh all = joined(parts);
  ASSERT_EQ(all.triangles.size(), 88U);
  ASSERT_EQ(all.corner_normals.size(), 88U);
  ASSERT_EQ(all.normals.size(), all.vertices.size());
  const TriangleMesh fine = tessellate_uniformly(all, 4).mesh;
  EXPECT_NEAR(area(fine), area(tessellate_uniformly(parts[0], 4).mesh) + area(flat_facets(parts[1])), 1e-9);
}

TEST(FitParts, CrumbsAreWhatHasNoRoomForPatches) {
  const TriangleMesh crumb = voxel(Vec3(0.8, 0.8, 5), Vec3::Zero());
  for (const double tolerance : {0.35, 0.5, 2.0}) {
    const auto flat = crumb_within(crumb, tolerance, 20);
    ASSERT_TRUE(flat.has_value()) << tolerance;
    HausdorffOptions measuring;
    measuring.width = 1e-3;
    EXPECT_LE(hausdorff(*flat, crumb, measuring).both.lower, tolerance);
    EXPECT_FALSE(why_unfit(examine(*flat)));
  }
  EXPECT_FALSE(crumb_within(crumb, 0.3, 20)) << "as many tolerances across as patches have room in";
  EXPECT_FALSE(crumb_within(ball(4, 10, Vec3::Zero()), 1, 20));
}

/// How many shells are within reach of a centre.
std::size_t shells_near(const ShellMesh& shell, const Vec3& centre, double reach) {
  return static_cast<std::size_t>(std::count_if(shell.triangles.begin(), shell.triangles.end(), [&](const auto& v) {
    return (shell.vertices[v[0]] - centre).norm() < reach;
  }));
}

TEST(FitParts, ACrumbLeavesTheOrganItsPatches) {
  const Vec3 at(25, 0, 0);
  const TriangleMesh organ = ball(3, 20, Vec3::Zero()), crumb = voxel(Vec3(0.6, 0.6, 4), at);
  const double tolerance = 0.3;
  const RelaxResult alone = relax(organ, Target(organ), fitting(tolerance));
  const TriangleMesh both = joined(std::array{organ, crumb});
  const Target target(both);
  const RelaxResult result = relax(both, target, fitting(tolerance));
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, tolerance);
  const std::size_t in_crumb = shells_near(result.shell, at, 3);
  EXPECT_GE(in_crumb, 4U);
  EXPECT_LE(in_crumb, crumb.triangles.size());
  EXPECT_LE(result.shell.triangles.size() - in_crumb, alone.shell.triangles.size() * 11 / 10);
  EXPECT_EQ(examine(flat_facets(result.shell)).components, 2U);
  ShellDistanceOptions measuring;
  measuring.width = 1e-3;
  const ShellDistance again = shell_distance(result.shell, target, measuring);
  EXPECT_LE(again.both.lower, result.distance.both.upper);
  EXPECT_LE(result.distance.both.lower, again.both.upper);
}

/// A cube: flat facets are its best shells.
TriangleMesh block(double side, const Vec3& centre) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.emplace_back(centre + side / 2 * Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TEST(FitParts, APartThatFlatFacetsServeBestLeavesTheOthersCurved) {
  const TriangleMesh organ = ball(3, 20, Vec3::Zero());
  const TriangleMesh both = joined(std::array{organ, block(12, Vec3(40, 0, 0))});
  const double tolerance = 0.3;
  const RelaxResult result = relax(both, Target(both), fitting(tolerance));
  EXPECT_EQ(result.reached, true);
  DecimateOptions flat;
  flat.max_error = tolerance;
  EXPECT_LT(2 * result.shell.triangles.size(), decimate(both, flat).mesh.triangles.size());
  EXPECT_LE(shells_near(result.shell, Vec3(40, 0, 0), 15), 12U);
}

TEST(FitParts, OfCrumbsAloneTheFlatFacetsAreTheResult) {
  const TriangleMesh both = joined(std::array{voxel(Vec3(1, 1, 2), Vec3::Zero()), voxel(Vec3(1, 1, 2), Vec3(4, 0, 0))});
  const RelaxResult result = relax(both, Target(both), fitting(0.3));
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.shell.triangles.size(), both.triangles.size());
  EXPECT_EQ(examine(flat_facets(result.shell)).components, 2U);
}

}  // namespace
}  // namespace tunica
