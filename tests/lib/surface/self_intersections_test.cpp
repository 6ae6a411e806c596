#include "tunica/surface/mesh/self_intersections.hpp"

#include "surface/shapes.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

TEST(SelfIntersections, CleanSurfacesHaveNone) {
  EXPECT_EQ(count_self_intersections(shapes::sphere(3)), 0U);
  EXPECT_EQ(count_self_intersections(shapes::torus(20, 10)), 0U);
  EXPECT_EQ(count_self_intersections(shapes::plane(4, 4)), 0U);
}

TEST(SelfIntersections, TwoCrossingTriangles) {
  const TriangleMesh mesh{{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}, {0, 2, 0.5}},
                          {{{0, 1, 2}, {3, 4, 5}}}};
  EXPECT_EQ(count_self_intersections(mesh), 1U);
  TriangleMesh apart = mesh;
  apart.vertices[3].z() = 1e-300;  // above the first triangle by less than any tolerance
  apart.vertices[5].z() = 1;
  EXPECT_EQ(count_self_intersections(apart), 0U);
  apart.vertices[3].z() = 0;  // touches it
  EXPECT_EQ(count_self_intersections(apart), 1U);
}

TEST(SelfIntersections, OverlappingSpheresCrossAlongACircle) {
  const TriangleMesh two = shapes::together(shapes::sphere(3), shapes::moved(shapes::sphere(3), {0.9, 0.1, 0.05}));
  const std::size_t pairs = count_self_intersections(two);
  EXPECT_GT(pairs, 40U);
  std::size_t brute_force = 0;
  for (Index i = 0; i < two.triangles.size(); ++i) {
    for (Index j = i + 1; j < two.triangles.size(); ++j) {
      TriangleMesh pair{two.vertices, {two.triangles[i], two.triangles[j]}};
      const double reach = (two.vertices[pair.triangles[0][0]] - two.vertices[pair.triangles[1][0]]).norm();
      brute_force += reach < 0.6 ? count_self_intersections(pair) : 0;
    }
  }
  EXPECT_EQ(pairs, brute_force);
}

TEST(SelfIntersections, TrianglesThatShareAVertexAreNoPair) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.5, 0.2, 1}, {0.5, 0.2, -1}}, {{{0, 1, 2}, {0, 3, 4}}}};
  EXPECT_EQ(count_self_intersections(mesh), 0U);
}

TEST(SelfIntersections, TrianglesWithACornerInCommonMayMeetElsewhere) {
  using Triangle = std::array<Vec3, 3>;
  const Triangle flat{Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(0, 2, 0)};
  const auto both_ways = [&](const Triangle& other) {
    const bool meet = triangles_cross_beside_corner(flat, other);
    EXPECT_EQ(triangles_cross_beside_corner(other, flat), meet);
    EXPECT_TRUE(triangles_cross(flat, other));  // at the corner, at least
    return meet;
  };
  EXPECT_TRUE(both_ways({Vec3(0, 0, 0), Vec3(1, 0.4, 1), Vec3(1, 0.4, -1)}));       // through it
  EXPECT_TRUE(both_ways({Vec3(0, 0, 0), Vec3(9, 3, 1), Vec3(9, 3, -1)}));           // through it and out
  EXPECT_FALSE(both_ways({Vec3(0, 0, 0), Vec3(1, -1e-9, 1), Vec3(1, -1e-9, -1)}));  // beside it
  EXPECT_FALSE(both_ways({Vec3(0, 0, 0), Vec3(1, 0.4, 1e-300), Vec3(1, 0.4, 1)}));  // above it, by nearly nothing
  EXPECT_TRUE(both_ways({Vec3(0, 0, 0), Vec3(1, 0.4, 0), Vec3(1, 0.4, 1)}));        // along it
  EXPECT_TRUE(both_ways({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(1, -1, 0)}));           // along its edge
  EXPECT_TRUE(both_ways({Vec3(0, 0, 0), Vec3(5, 4, 0), Vec3(4, 5, 0)}));            // over it, in its plane
  EXPECT_FALSE(both_ways({Vec3(0, 0, 0), Vec3(-1, 0.5, 0), Vec3(0.5, -1, 0)}));     // in its plane, elsewhere
  EXPECT_FALSE(triangles_cross_beside_corner(flat, {Vec3(0, 0, 0), Vec3(0, 0, 0), Vec3(1, 0.5, 0)}));  // no area
}

TEST(SelfIntersections, BoxesThatOverlap) {
  const std::vector<Vec3> lower{{0, 0, 0}, {1, 1, 1}, {3, 0, 0}, {1.5, 1.5, 1.5}};
  const std::vector<Vec3> upper{{1, 1, 1}, {2, 2, 2}, {4, 1, 1}, {1.6, 1.6, 1.6}};
  EXPECT_EQ(overlapping_boxes(lower, upper), (std::vector<std::array<Index, 2>>{{0, 1}, {1, 3}}));
}

TEST(SelfIntersections, PatchesAreCountedOnce) {
  // Two flat patches of four triangles each cross in several triangles.
  const TriangleMesh one = shapes::split({{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{{0, 1, 2}}}});
  const TriangleMesh other = shapes::split({{{0, -1, -1}, {0, -1, 1}, {0, 1, 0}}, {{{0, 1, 2}}}});
  const TriangleMesh both = shapes::together(one, other);
  const std::vector<Index> patch{0, 0, 0, 0, 1, 1, 1, 1};
  EXPECT_GT(count_self_intersections(both), 1U);
  EXPECT_EQ(count_self_intersections(both, patch, {{0, 1, 2}, {3, 4, 5}}), 1U);
  EXPECT_EQ(count_self_intersections(both, patch, {{0, 1, 2}, {2, 4, 5}}), 0U);
}

TEST(SelfIntersections, DegenerateTrianglesAreLeftOut) {
  const TriangleMesh mesh{{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}, {0, 0, 2}},
                          {{{0, 1, 2}, {3, 4, 5}}}};
  EXPECT_EQ(count_self_intersections(mesh), 0U);
}

}  // namespace
}  // namespace tunica
