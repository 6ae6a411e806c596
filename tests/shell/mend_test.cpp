#include "shell/mend.hpp"

#include "shell/families.hpp"
#include "shell/normals.hpp"
#include "surface/checks.hpp"
#include "surface/closest_point.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace tunica {
namespace {

/// A neighbour of a vertex.
Index beside(const TriangleMesh& mesh, Index v) {
  const auto& corners = mesh.triangles[incidence(mesh).of(v)[0]];
  return corners[0] == v ? corners[1] : corners[0];
}

/// The least agreement of a node's best normal with its facets.
double least_agreement(const TriangleMesh& mesh) {
  const auto facets = facet_normals(mesh);
  const auto around = incidence(mesh);
  double least = 1;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    std::vector<Vec3> fan;
    for (const Index t : around.of(static_cast<Index>(v))) {
      fan.push_back(facets[t]);
    }
    least = std::min(least, most_compatible_normal(fan).agreement);
  }
  return least;
}

void expect_same_topology(const TriangleMesh& mesh, const TriangleMesh& as) {
  const MeshFacts facts = examine(mesh), before = examine(as);
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_EQ(facts.euler, before.euler);
  EXPECT_EQ(facts.boundary_loops, before.boundary_loops);
  EXPECT_EQ(facts.components, before.components);
  EXPECT_EQ(facts.unused_vertices, 0U);
}

TEST(Mend, AGoodMeshIsLeftAsItIs) {
  const Target target(testing::sphere(4));
  const TriangleMesh given = testing::sphere(2);
  TriangleMesh mesh = given;
  const Mending done = mend(target, mesh, 0.05);
  EXPECT_EQ(done.turned + done.merged + done.shifted, 0U);
  EXPECT_EQ(mesh.vertices, given.vertices);
  EXPECT_EQ(mesh.triangles, given.triangles);
}

TEST(Mend, NeedlesAndCapsGo) {
  const Target target(testing::sphere(4));
  TriangleMesh given = testing::sphere(2);
  for (const Index v : {20U, 70U, 110U}) {
    const Vec3 to = given.vertices[beside(given, v)];
    given.vertices[v] = (0.04 * given.vertices[v] + 0.96 * to).normalized();
  }
  for (const Index v : {45U, 140U}) {
    // Onto the edge opposite: the triangle between is a cap.
    const auto& corners = given.triangles[incidence(given).of(v)[0]];
    Vec3 sum = -given.vertices[v];
    for (const Index c : corners) {
      sum += given.vertices[c];
    }
    given.vertices[v] = (0.05 * given.vertices[v] + 0.95 * sum / 2).normalized();
  }
  ASSERT_LT(min_angle_degrees(given), 5);
  TriangleMesh mesh = given;
  const Mending done = mend(target, mesh, 0.05);
  EXPECT_GE(done.turned + done.merged + done.shifted, 4U);
  EXPECT_GE(min_angle_degrees(mesh), MendLimits{}.angle);
  EXPECT_EQ(given.vertices.size() - mesh.vertices.size(), done.merged);
  expect_same_topology(mesh, given);
  for (const auto& [a, b, c] : mesh.triangles) {
    EXPECT_LE(target.closest((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3).distance, 0.05);
  }
}

TEST(Mend, FoldsGo) {
  const Target target(testing::sphere(4));
  TriangleMesh given = testing::sphere(2);
  const auto& corners = given.triangles[incidence(given).of(60)[0]];
  Vec3 away = Vec3::Zero();
  for (const Index c : corners) {
    away += given.vertices[c] - given.vertices[60];
  }
  given.vertices[60] = (given.vertices[60] + 1.2 * away).normalized();  // beyond the opposite edge
  ASSERT_LT(least_agreement(given), MendLimits{}.agreement);
  TriangleMesh mesh = given;
  const Mending done = mend(target, mesh, 0.05);
  EXPECT_GE(done.turned + done.merged + done.shifted, 1U);
  EXPECT_GE(least_agreement(mesh), MendLimits{}.agreement);
  EXPECT_GE(min_angle_degrees(mesh), MendLimits{}.angle);
  expect_same_topology(mesh, given);
}

TEST(Mend, BoundaryNodesStay) {
  const Target target(testing::cylinder(48, 40, 10, 30));
  TriangleMesh given = testing::cylinder(16, 8, 10, 30);
  const auto loops = boundary_loops(given);
  // A node next to the boundary nearly on it, and one inside nearly on its neighbour.
  given.vertices[16 + 3].z() = 0.1;
  given.vertices[4 * 16 + 5] = 0.03 * given.vertices[4 * 16 + 5] + 0.97 * given.vertices[4 * 16 + 6];
  ASSERT_LT(min_angle_degrees(given), 5);
  TriangleMesh mesh = given;
  mend(target, mesh, 0.3);
  EXPECT_GE(min_angle_degrees(mesh), MendLimits{}.angle);
  expect_same_topology(mesh, given);
  for (const auto& loop : loops) {
    for (const Index v : loop) {
      EXPECT_NE(std::find(mesh.vertices.begin(), mesh.vertices.end(), given.vertices[v]), mesh.vertices.end()) << v;
    }
  }
}

TEST(Mend, WhatWouldStrayIsNotDone) {
  // A ridge of two planes at right angles with a needle across its edge: turning that edge would cut the ridge off.
  TriangleMesh given;
  given.vertices = {{0, 0, 0}, {1, 0, 0}, {0.5, 0.06, -0.06}, {0.5, -0.06, -0.06}};
  given.triangles = {{0, 1, 2}, {1, 0, 3}};
  const Target target(given);
  ASSERT_LT(min_angle_degrees(given), 10);
  TriangleMesh mesh = given;
  mend(target, mesh, 0.01);
  EXPECT_EQ(mesh.triangles, given.triangles);
  EXPECT_EQ(mesh.vertices, given.vertices);
  mend(target, mesh, 0.1);
  EXPECT_NE(mesh.triangles, given.triangles) << "within 0.1 the ridge does not matter";
}

TEST(Mend, LimitsSayWhatIsBad) {
  const Target target(testing::sphere(4));
  TriangleMesh given = testing::sphere(2);
  given.vertices[70] = (0.25 * given.vertices[70] + 0.75 * given.vertices[beside(given, 70)]).normalized();
  const double angle = min_angle_degrees(given);
  ASSERT_GT(angle, 8);
  ASSERT_LT(angle, 18);
  TriangleMesh mesh = given;
  MendLimits limits;
  limits.angle = angle - 1;
  mend(target, mesh, 0.05, limits);
  EXPECT_EQ(mesh.triangles, given.triangles);
  limits.angle = 20;
  mend(target, mesh, 0.05, limits);
  EXPECT_GE(min_angle_degrees(mesh), 20);
}

}  // namespace
}  // namespace tunica
