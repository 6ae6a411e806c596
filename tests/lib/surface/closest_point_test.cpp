#include "tunica/surface/distance/closest_point.hpp"

#include "surface/shapes.hpp"
#include "tunica/core/threads.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

double brute_force(const TriangleMesh& mesh, const Vec3& p) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& [i, j, k] : mesh.triangles) {
    const Vec3 q = closest_point_on_triangle(p, mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]);
    best = std::min(best, (p - q).norm());
  }
  return best;
}

void expect_as_brute_force(const TriangleMesh& mesh, std::uint32_t seed) {
  const ClosestPoint tree(mesh);
  std::mt19937 random(seed);
  const auto unit = [&] { return 3 * static_cast<double>(random()) / 4294967295.0 - 1; };
  for (int i = 0; i < 200; ++i) {
    const Vec3 p(unit(), unit(), unit());
    const auto hit = tree.closest(p);
    const double distance = std::sqrt(hit.squared_distance);
    EXPECT_NEAR(distance, brute_force(mesh, p), 1e-12);
    EXPECT_NEAR((p - hit.point).norm(), distance, 1e-14);
    EXPECT_NEAR(std::sqrt(tree.squared_distance_to(p, hit.triangle)), distance, 1e-14);
    const auto guess = static_cast<Index>(random() % mesh.triangles.size());
    EXPECT_NEAR(std::sqrt(tree.closest(p, guess).squared_distance), distance, 1e-12);
    const auto corners = tree.corners(hit.triangle);
    EXPECT_EQ(tree.closest(corners[0]).squared_distance, 0);
  }
}

TEST(ClosestPointOnTriangle, EachRegion) {
  const Vec3 a(0, 0, 0);
  const Vec3 b(4, 0, 0);
  const Vec3 c(0, 4, 0);
  const auto closest = [&](double x, double y, double z) { return closest_point_on_triangle({x, y, z}, a, b, c); };
  EXPECT_TRUE(closest(1, 1, 5).isApprox(Vec3(1, 1, 0)));
  EXPECT_TRUE(closest(2, -1, 3).isApprox(Vec3(2, 0, 0)));
  EXPECT_TRUE(closest(-1, 3, -3).isApprox(Vec3(0, 3, 0)));
  EXPECT_TRUE(closest(3, 3, 1).isApprox(Vec3(2, 2, 0)));
  EXPECT_EQ(closest(-1, -2, 1), a);
  EXPECT_EQ(closest(6, 1, 1), b);
  EXPECT_EQ(closest(-0.5, 7, 1), c);
}

TEST(ClosestPointOnTriangle, DegenerateTrianglesAreSegmentsAndPoints) {
  const Vec3 a(0, 0, 0);
  const Vec3 b(2, 0, 0);
  EXPECT_TRUE(closest_point_on_triangle({1.5, 1, 0}, a, b, {1, 0, 0}).isApprox(Vec3(1.5, 0, 0)));
  EXPECT_EQ(closest_point_on_triangle({3, 4, 0}, b, b, b), b);
}

TEST(ClosestPointOnTriangle, NeedleIsNeverFartherThanItsEdges) {
  std::mt19937 random(3);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967295.0 - 0.5; };
  for (int i = 0; i < 2000; ++i) {
    const double thin = std::pow(10.0, -static_cast<double>(i % 17));
    const Vec3 a(unit(), unit(), unit());
    const Vec3 b(unit(), unit(), unit());
    const Vec3 c = a + (0.5 + unit()) * (b - a) + thin * Vec3(unit(), unit(), unit());
    const Vec3 p(unit(), unit(), unit());
    const double distance = (p - closest_point_on_triangle(p, a, b, c)).norm();
    for (int k = 0; k <= 50; ++k) {
      EXPECT_LE(distance, (p - (a + k / 50.0 * (b - a))).norm() + 1e-15);
      EXPECT_LE(distance, (p - (a + k / 50.0 * (c - a))).norm() + 1e-15);
    }
  }
}

TEST(ClosestPoint, AgreesWithBruteForce) {
  expect_as_brute_force(shapes::sphere(3), 1);
  expect_as_brute_force(shapes::torus(20, 10, 0.5, 0.2), 2);
  expect_as_brute_force(shapes::plane(30, 1), 3);
  expect_as_brute_force(shapes::tetrahedron(), 4);
}

TEST(ClosestPoint, AgreesWithBruteForceOnNeedleSoup) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    expect_as_brute_force(shapes::soup(150, seed), 10 + seed);
  }
}

TEST(ClosestPoint, OneTriangleAndCoincidentTriangles) {
  TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{{0, 1, 2}}}};
  EXPECT_EQ(ClosestPoint(mesh).closest({0.25, 0.25, 2}).squared_distance, 4);
  mesh.triangles.assign(100, {0, 1, 2});
  EXPECT_EQ(ClosestPoint(mesh).closest({0.25, 0.25, 2}).squared_distance, 4);
}

TEST(ClosestPoint, TinyAndHugeMeshes) {
  for (const double scale : {1e-9, 1e9}) {
    const ClosestPoint tree(shapes::moved(shapes::sphere(3), Vec3::Zero(), scale));
    EXPECT_NEAR(std::sqrt(tree.closest({3 * scale, 0, 0}).squared_distance) / scale, 2, 1e-12);
  }
}

TEST(ClosestPoint, LargestDistanceToOneTriangleIsAtACorner) {
  const ClosestPoint tree(shapes::sphere(2));
  const std::array<Vec3, 3> points{Vec3(2, 0, 0), Vec3(0, 3, 0), Vec3(1, 1, 2)};
  for (Index t = 0; t < 20; ++t) {
    double largest = 0;
    for (const Vec3& p : points) {
      largest = std::max(largest, tree.squared_distance_to(p, t));
    }
    EXPECT_NEAR(tree.max_squared_distance_to(points, t), largest, 1e-12);
  }
}

TEST(ClosestPoint, SpatialOrderHoldsEachTriangleOnce) {
  const TriangleMesh mesh = shapes::sphere(3);
  std::vector<Index> order = ClosestPoint(mesh).spatial_order();
  std::sort(order.begin(), order.end());
  ASSERT_EQ(order.size(), mesh.triangles.size());
  for (Index t = 0; t < order.size(); ++t) {
    EXPECT_EQ(order[t], t);
  }
}

TEST(ClosestPoint, LargeTreesAreTheSameOnAnyNumberOfThreads) {
  const TriangleMesh mesh = shapes::together(shapes::shaken(shapes::sphere(6), 0.02, 3), shapes::soup(300, 4));
  const std::size_t before = thread_count();
  set_thread_count(1);
  const ClosestPoint one(mesh);
  set_thread_count(4);
  const ClosestPoint four(mesh);
  set_thread_count(before);
  EXPECT_EQ(one.spatial_order(), four.spatial_order());
  auto sorted = one.spatial_order();
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    ASSERT_EQ(sorted[t], t);
  }
  std::mt19937 random(7);
  for (int i = 0; i < 60; ++i) {
    const auto coordinate = [&] { return 4 * static_cast<double>(random()) / 4294967295.0 - 2; };
    const Vec3 p(coordinate(), coordinate(), coordinate());
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : mesh.triangles) {
      least = std::min(
          least,
          (p - closest_point_on_triangle(p, mesh.vertices[a], mesh.vertices[b], mesh.vertices[c])).squaredNorm());
    }
    EXPECT_NEAR(four.closest(p).squared_distance, least, 1e-12);
    EXPECT_EQ(one.closest(p).triangle, four.closest(p).triangle);
  }
}

}  // namespace
}  // namespace tunica
