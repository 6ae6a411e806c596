#include "surface/self_intersections.hpp"

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
