#include "surface/surface_walk.hpp"

#include "surface/shapes.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tunica {
namespace {

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

TEST(SurfaceWalk, TrianglesWithoutAreaGiveNoDistanceThatIsTooSmall) {
  const FlatTriangle needle({0, 0, 0}, {1, 1e-17, 0}, {3, 0, 0});
  const FlatTriangle point({1, 1, 1}, {1, 1, 1}, {1, 1, 1});
  EXPECT_NEAR(needle.squared_distance({-1, 1, 0}), 2, 1e-12);
  EXPECT_NEAR(needle.squared_distance({2, 0, 2}), 4, 1e-12);
  EXPECT_NEAR(needle.squared_distance({5, 0, 0}), 4, 1e-12);
  EXPECT_NEAR(point.squared_distance({1, 1, 3}), 4, 1e-12);
}

}  // namespace
}  // namespace tunica
