#include "tunica/surface/mesh/checks.hpp"

#include "surface/shapes.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tunica {
namespace {

using shapes::sphere;
using testing::HasSubstr;
using testing::Optional;

TEST(Measure, CubeCornerTetrahedron) {
  const TriangleMesh mesh = shapes::moved(shapes::tetrahedron(), {1e6, -1e6, 0}, 2);
  EXPECT_NEAR(signed_volume(mesh), 8.0 / 6, 1e-8);
  EXPECT_NEAR(area(mesh), 6 + 2 * std::sqrt(3.0), 1e-8);
  EXPECT_NEAR(diagonal(mesh), 2 * std::sqrt(3.0), 1e-9);
}

TEST(Measure, BoxLeavesOutUnusedVertices) {
  TriangleMesh mesh = shapes::tetrahedron();
  mesh.vertices.emplace_back(100, 100, 100);
  EXPECT_DOUBLE_EQ(diagonal(mesh), std::sqrt(3.0));
  EXPECT_EQ(diagonal({}), 0);
}

TEST(Measure, SphereVolumeConvergesWithSecondOrder) {
  const double exact = 4.0 / 3 * std::numbers::pi;
  const double coarse = exact - signed_volume(sphere(3));
  const double fine = exact - signed_volume(sphere(4));
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.05);
}

TEST(Measure, AnglesAndQuality) {
  const Vec3 a(0, 0, 0);
  const Vec3 b(1, 0, 0);
  EXPECT_NEAR(smallest_angle_degrees(a, b, {0.5, std::sqrt(0.75), 0}), 60, 1e-12);
  EXPECT_NEAR(radius_ratio(a, b, {0.5, std::sqrt(0.75), 0}), 1, 1e-12);
  EXPECT_NEAR(smallest_angle_degrees(a, b, {0, 1, 0}), 45, 1e-12);
  EXPECT_NEAR(radius_ratio(a, b, {0, 1, 0}), 2 * std::sqrt(2.0) - 2, 1e-12);
  EXPECT_NEAR(smallest_angle_degrees(a, b, {0, 1e-7, 0}), 1e-7 * 180 / std::numbers::pi, 1e-15);
  EXPECT_EQ(smallest_angle_degrees(a, b, b), 0);
  EXPECT_EQ(radius_ratio(a, a, a), 0);
}

TEST(Checks, ClosedSphere) {
  const MeshFacts facts = examine(sphere(2));
  EXPECT_TRUE(facts.closed && facts.manifold && facts.oriented);
  EXPECT_EQ(facts.euler, 2);
  EXPECT_EQ(facts.components, 1U);
  EXPECT_EQ(facts.triangles, 128U);
  EXPECT_EQ(facts.edges, 192U);
  EXPECT_EQ(why_unfit(facts, Boundary::forbidden), std::nullopt);
}

TEST(Checks, TorusHasEulerNumberZero) { EXPECT_EQ(examine(shapes::torus(12, 8)).euler, 0); }

TEST(Checks, TubeHasTwoLoops) {
  const TriangleMesh mesh = shapes::tube(12, 4);
  const MeshFacts facts = examine(mesh);
  EXPECT_TRUE(!facts.closed && facts.manifold && facts.oriented);
  EXPECT_EQ(facts.boundary_loops, 2U);
  EXPECT_EQ(facts.boundary_edges, 24U);
  EXPECT_EQ(why_unfit(facts), std::nullopt);
  EXPECT_THAT(why_unfit(facts, Boundary::forbidden), Optional(HasSubstr("24 edges have a triangle on one side only")));
  const auto loops = boundary_loops(mesh);
  ASSERT_EQ(loops.size(), 2U);
  EXPECT_EQ(loops[0].size(), 12U);
  EXPECT_EQ(loops[1].size(), 12U);
}

TEST(Checks, PiecesAndUnusedVertices) {
  TriangleMesh mesh = shapes::together(sphere(1), shapes::moved(sphere(1), {5, 0, 0}));
  mesh.vertices.emplace_back(9, 9, 9);
  const MeshFacts facts = examine(mesh);
  EXPECT_EQ(facts.components, 2U);
  EXPECT_EQ(facts.unused_vertices, 1U);
  EXPECT_EQ(facts.euler, 4);
}

TEST(Checks, EdgeOfThreeTriangles) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}},
                          {{{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}}};
  const MeshFacts facts = examine(mesh);
  EXPECT_EQ(facts.non_manifold_edges, 1U);
  EXPECT_FALSE(facts.manifold);
  EXPECT_THAT(why_unfit(facts), Optional(HasSubstr("between vertices 0 and 1 near (0.5, 0, 0)")));
}

TEST(Checks, PinchedVertex) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}}, {{{0, 1, 2}, {0, 3, 4}}}};
  const MeshFacts facts = examine(mesh);
  EXPECT_EQ(facts.non_manifold_vertices, 1U);
  EXPECT_EQ(facts.components, 2U);
  EXPECT_THAT(why_unfit(facts), Optional(HasSubstr("vertex 0 near (0, 0, 0)")));
}

TEST(Checks, FlippedTriangle) {
  TriangleMesh mesh = sphere(1);
  std::swap(mesh.triangles[5][0], mesh.triangles[5][1]);
  const MeshFacts facts = examine(mesh);
  EXPECT_EQ(facts.inconsistent_edges, 3U);
  EXPECT_TRUE(facts.manifold);
  EXPECT_THAT(why_unfit(facts), Optional(HasSubstr("face opposite ways")));
}

TEST(Checks, DuplicateTriangleAndPillow) {
  const TriangleMesh pillow{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{{0, 1, 2}, {1, 0, 2}}}};
  const MeshFacts facts = examine(pillow);
  EXPECT_EQ(facts.duplicate_triangles, 1U);
  EXPECT_FALSE(facts.manifold);
  TriangleMesh mesh = sphere(1);
  mesh.triangles.push_back(mesh.triangles[7]);
  EXPECT_EQ(examine(mesh).duplicate_triangles, 1U);
}

TEST(Checks, RepeatedCornerAndNoHeight) {
  TriangleMesh mesh = shapes::plane(2, 1);
  mesh.triangles.push_back({0, 0, 1});
  EXPECT_EQ(examine(mesh).degenerate_triangles, 1U);
  EXPECT_FALSE(examine(mesh).manifold);
  const TriangleMesh flat{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{{0, 1, 2}}}};
  EXPECT_EQ(examine(flat).degenerate_triangles, 1U);
  EXPECT_TRUE(examine(flat).manifold);
}

TEST(Checks, NotFinite) {
  TriangleMesh mesh = sphere(1);
  mesh.vertices[3].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(why_unfit(examine(mesh)), Optional(HasSubstr("vertex 3")));
}

TEST(Checks, EmptyMesh) { EXPECT_THAT(why_unfit(examine({})), Optional(HasSubstr("no triangles"))); }

}  // namespace
}  // namespace tunica
