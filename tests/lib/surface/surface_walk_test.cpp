#include "tunica/surface/distance/surface_walk.hpp"

#include "surface/shapes.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/distance/facet_distances.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/subdivide.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tunica {
namespace {

TEST(PartsForPoints, AreAsWantedUnlessThatWouldBeTooManyPoints) {
  TriangleMesh mesh = shapes::plane(2, 1);
  mesh.vertices[0] = {-3, 0, 0};  // the two triangles beside are long
  const auto wanted = [](double longest) { return 4 * longest; };
  const std::vector<int> plenty = parts_for_points(mesh, wanted, 1e6);
  double points = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    EXPECT_EQ(plenty[t], static_cast<int>(wanted(longest_edge(mesh, t))));
    points += 0.5 * plenty[t] * plenty[t];
  }
  EXPECT_GT(points, 100);
  const std::vector<int> few = parts_for_points(mesh, wanted, 30);
  double left = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    EXPECT_LT(few[t], plenty[t]);
    EXPECT_GT(few[t], 0);
    left += 0.5 * few[t] * few[t];
  }
  EXPECT_LE(left, 30);
  EXPECT_GT(left, 10);
}

TEST(SurfaceWalk, NeverNearerThanTheClosestPointAndMostlyThere) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const std::vector<TriangleMesh> meshes{
      shapes::sphere(4), shapes::shaken(shapes::torus(40, 20), 0.1, 2), shapes::tube(40, 3),
      shapes::together(shapes::plane(30, 20), shapes::moved(shapes::plane(2, 1), {0.01, 0, 0.02}))};
  for (const TriangleMesh& mesh : meshes) {
    const ClosestPoint tree(mesh);
    const SurfaceWalk walk(mesh);
    std::size_t missed = 0;
    constexpr std::size_t points = 2000;
    for (std::size_t i = 0; i < points; ++i) {
      const auto start = static_cast<Index>(random() % mesh.triangles.size());
      const auto& c = mesh.triangles[random() % mesh.triangles.size()];
      const Vec3 p = mesh.vertices[c[0]] + 0.1 * Vec3(uniform(random), uniform(random), uniform(random));
      const double truth = std::sqrt(tree.closest(p).squared_distance);
      for (const auto& hit : {walk.closest(p, start), walk.near_by(p, start)}) {
        EXPECT_NEAR((hit.point - p).squaredNorm(), hit.squared_distance, 1e-14);
        EXPECT_NEAR(tree.squared_distance_to(p, hit.triangle), hit.squared_distance, 1e-12);
        EXPECT_GE(std::sqrt(hit.squared_distance), truth - 1e-9);
      }
      missed += std::sqrt(walk.closest(p, start).squared_distance) > truth + 1e-9 ? 1 : 0;
    }
    EXPECT_LE(missed, points / 50);
  }
}

TEST(SurfaceWalk, WhatIsNearEnoughMayEndTheSearchAndNothingElse) {
  const TriangleMesh mesh = shapes::shaken(shapes::torus(40, 20), 0.1, 2);
  const SurfaceWalk walk(mesh);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (std::size_t i = 0; i < 1000; ++i) {
    const auto start = static_cast<Index>(random() % mesh.triangles.size());
    const Vec3 p = mesh.vertices[random() % mesh.vertices.size()] + 0.1 * Vec3(uniform(random), uniform(random), 0);
    const double truth = walk.closest(p, start).squared_distance;
    for (const double enough : {0.5 * truth, 1.5 * truth, 1.0}) {
      const double found = walk.closest(p, start, enough).squared_distance;
      EXPECT_LE(found, std::max(truth * (1 + 1e-9), enough));
    }
  }
}

TEST(FacetDistances, SeveralAtOnceAreThoseOfOne) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto any = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  for (int i = 0; i < 500; ++i) {
    const std::array<Vec3, 3> c{any(), any(), any()};
    std::array<Vec3, lane_count> points;
    std::generate(points.begin(), points.end(), any);
    const Lanes squared = FacetDistances(c).squared_distance(lane_points([&](std::size_t k) { return points[k]; }));
    for (std::size_t k = 0; k < lane_count; ++k) {
      EXPECT_NEAR(squared[k], FlatTriangle(c[0], c[1], c[2]).squared_distance(points[k]), 1e-12);
    }
  }
}

TEST(FacetDistances, AreThoseOfTheClosestPoint) {
  const std::vector<std::array<Vec3, 3>> triangles{
      {Vec3(0, 0, 0), Vec3(1, 0.2, 0), Vec3(0.3, 0.8, 0.1)},
      {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0.5, 0, 0)},     // no area
      {Vec3(1, 1, 1), Vec3(1, 1, 1), Vec3(1, 1, 1)},       // a point
      {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0.5, 1e-9, 0)},  // a needle
  };
  std::mt19937 random(3);
  std::uniform_real_distribution<double> coordinate(-1, 2);
  for (const auto& c : triangles) {
    const FacetDistances flat(c);
    for (int i = 0; i < 300; ++i) {
      const LaneVec3 p = lane_points([&](std::size_t) { return Vec3(coordinate(random), coordinate(random), 0.3); });
      const Lanes squared = flat.squared_distance(p);
      for (std::size_t k = 0; k < lane_count; ++k) {
        const Vec3 q(p[0][k], p[1][k], p[2][k]);
        EXPECT_NEAR(squared[k], (closest_point_on_triangle(q, c[0], c[1], c[2]) - q).squaredNorm(), 1e-9);
      }
    }
  }
}

TEST(SurfaceWalk, TrianglesWithoutAreaGiveNoDistanceThatIsTooSmall) {
  const FlatTriangle needle({0, 0, 0}, {1, 1e-17, 0}, {3, 0, 0});
  const FlatTriangle point({1, 1, 1}, {1, 1, 1}, {1, 1, 1});
  const std::array<Vec3, 4> points{Vec3(5, 0, 0), Vec3(-1, 1, 0), Vec3(2, 0, 2), Vec3(3, 2, 0)};
  const Lanes squared = FacetDistances({Vec3(0, 0, 0), Vec3(1, 1e-17, 0), Vec3(3, 0, 0)})
                            .squared_distance(lane_points([&](std::size_t k) { return points[k % 4]; }));
  for (std::size_t k = 0; k < std::min(lane_count, points.size()); ++k) {
    EXPECT_NEAR(squared[k], (std::array<double, 4>{4, 2, 4, 4}[k]), 1e-12);
  }
  EXPECT_NEAR(needle.squared_distance({-1, 1, 0}), 2, 1e-12);
  EXPECT_NEAR(needle.squared_distance({2, 0, 2}), 4, 1e-12);
  EXPECT_NEAR(needle.squared_distance({5, 0, 0}), 4, 1e-12);
  EXPECT_NEAR(point.squared_distance({1, 1, 3}), 4, 1e-12);
}

}  // namespace
}  // namespace tunica
