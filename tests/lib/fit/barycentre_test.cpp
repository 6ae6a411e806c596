#include "tunica/fit/barycentre.hpp"

#include "shell/families.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>

namespace tunica {
namespace {

constexpr double anywhere = 1e9;

/// A square plate in z = 0 of side 1, n x n x 2 triangles, facing up (or down).
TriangleMesh plate(int n, double z, bool up) {
  TriangleMesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(static_cast<double>(i) / n, static_cast<double>(j) / n, z);
    }
  }
  const auto at = [n](int i, int j) { return static_cast<Index>(j * (n + 1) + i); };
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  if (!up) {
    for (auto& v : mesh.triangles) {
      std::swap(v[1], v[2]);
    }
  }
  return mesh;
}

TriangleMesh together(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const auto offset = static_cast<Index>(a.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& [i, j, k] : b.triangles) {
    mesh.triangles.push_back({i + offset, j + offset, k + offset});
  }
  return mesh;
}

TEST(Barycentre, MovesANodeToTheBarycentreOfTheThreeClosestCentroids) {
  const TriangleMesh fine = testing::sphere(3);
  const Target target(fine);
  TriangleMesh mesh = testing::sphere(1, 1.1);
  const TriangleMesh before = mesh;
  const NodeMoves moves = move_by_barycentre(target, mesh, anywhere);
  EXPECT_EQ(moves.by_rule, mesh.vertices.size());
  std::vector<Vec3> centroids;
  for (const auto& [a, b, c] : fine.triangles) {
    centroids.emplace_back((fine.vertices[a] + fine.vertices[b] + fine.vertices[c]) / 3);
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3& p = before.vertices[v];
    std::partial_sort(centroids.begin(), centroids.begin() + 3, centroids.end(),
                      [&](const Vec3& a, const Vec3& b) { return (a - p).squaredNorm() < (b - p).squaredNorm(); });
    // Nodes over a vertex of the target have six centroids at one distance: then any three of them will do.
    const double reach = (centroids[2] - p).norm();
    const Vec3 expected = (centroids[0] + centroids[1] + centroids[2]) / 3;
    if (std::abs((*std::min_element(
                      centroids.begin() + 3, centroids.end(),
                      [&](const Vec3& a, const Vec3& b) { return (a - p).squaredNorm() < (b - p).squaredNorm(); }) -
                  p)
                     .norm() -
                 reach) > 1e-9) {
      EXPECT_LT((mesh.vertices[v] - expected).norm(), 1e-12);
    }
    EXPECT_NEAR(mesh.vertices[v].norm(), 1, 0.02);
  }
}

TEST(Barycentre, ANodeOfAThinOrganDoesNotJumpToTheOppositeWall) {
  // Two walls 0.02 apart; the coarse upper wall lies lower than the middle, closer to the lower wall.
  const Target target(together(plate(40, 0.02, true), plate(40, 0, false)));
  TriangleMesh upper = plate(4, 0.005, true);
  move_by_barycentre(target, upper, anywhere);
  for (const Vec3& p : upper.vertices) {
    EXPECT_NEAR(p.z(), 0.02, 1e-12);
  }
  TriangleMesh lower = plate(4, 0.015, false);
  move_by_barycentre(target, lower, anywhere);
  for (const Vec3& p : lower.vertices) {
    EXPECT_NEAR(p.z(), 0, 1e-12);
  }
}

TEST(Barycentre, ABoundaryDoesNotShrinkHoweverOftenTheRuleIsApplied) {
  const Target target(testing::cylinder(64, 40, 1, 3));
  TriangleMesh mesh = testing::cylinder(9, 4, 1.05, 3.1);
  for (int i = 0; i < 10; ++i) {
    move_by_barycentre(target, mesh, anywhere);
  }
  std::size_t low = 0, high = 0;
  for (const Vec3& p : mesh.vertices) {
    low += std::abs(p.z()) < 1e-12;
    high += std::abs(p.z() - 3) < 1e-12;
    EXPECT_NEAR(std::hypot(p.x(), p.y()), 1, 0.01);
  }
  EXPECT_EQ(low, 9u);
  EXPECT_EQ(high, 9u);
}

TEST(Barycentre, EachLoopGoesToItsOwnCurveOfTheTarget) {
  const Target target(testing::cylinder(32, 20, 1, 3));
  const TriangleMesh mesh = testing::cylinder(9, 4, 1, 3);
  std::vector<std::vector<Index>> loops{{0, 1, 2, 3, 4, 5, 6, 7, 8}, {36, 37, 38, 39, 40, 41, 42, 43, 44}};
  const auto curves = match_boundaries(target, mesh, loops);
  ASSERT_TRUE(curves[0] && curves[1]);
  EXPECT_NEAR(target.boundary()[*curves[0]][0].z(), 0, 1e-12);
  EXPECT_NEAR(target.boundary()[*curves[1]][0].z(), 3, 1e-12);
}

TEST(Barycentre, ABoundaryThatFoldsOntoItsCurveIsSpreadOverIt) {
  // A loop so far off that most closest points fall together.
  const Target target(testing::cylinder(64, 40, 1, 3));
  TriangleMesh mesh = testing::cylinder(9, 4, 1, 3);
  for (std::size_t v = 0; v < 9; ++v) {
    mesh.vertices[v].x() += 1.5;
  }
  move_by_barycentre(target, mesh, anywhere);
  for (std::size_t v = 0; v < 9; ++v) {
    EXPECT_GT((mesh.vertices[v] - mesh.vertices[(v + 1) % 9]).norm(), 0.2);
  }
}

TEST(Barycentre, TrianglesOfTheTargetLargerThanTheShellsDoNotPullNodesTogether) {
  const Target target(plate(1, 0, true));  // two triangles
  TriangleMesh mesh = plate(8, 0.1, true);
  move_by_barycentre(target, mesh, anywhere);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Vec3 expected(static_cast<double>(v % 9) / 8, static_cast<double>(v / 9) / 8, 0);
    EXPECT_LT((mesh.vertices[v] - expected).norm(), 1e-12);
  }
}

TEST(Barycentre, ABarycentreTooFarOffTheTargetGivesWayToTheClosestPoint) {
  const Target target(testing::sphere(2));
  TriangleMesh mesh = testing::sphere(1, 1.1);
  const NodeMoves moves = move_by_barycentre(target, mesh, 1e-9);
  EXPECT_EQ(moves.to_closest_point, mesh.vertices.size());
  for (const Vec3& p : mesh.vertices) {
    EXPECT_LT(target.closest(p).distance, 1e-12);
  }
}

TEST(Barycentre, NoTriangleFlipsOrCollapsesOnTheWay) {
  // A coarse mesh whose nodes would cross: one node stands beyond its neighbour.
  const Target target(plate(60, 0, true));
  TriangleMesh mesh = plate(6, 0.02, true);
  mesh.vertices[24] += Vec3(0.9 / 6, 0.7 / 6, 0.3);
  TriangleMesh before = mesh;
  for (int i = 0; i < 5; ++i) {
    move_by_barycentre(target, mesh, anywhere);
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 n = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    EXPECT_GT(n.z(), 0) << t;
  }
}

}  // namespace
}  // namespace tunica
