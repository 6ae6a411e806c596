#include "tunica/surface/mesh/point_tree.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace tunica {
namespace {

std::vector<Index> by_sorting(const std::vector<Vec3>& points, const Vec3& p, std::size_t k,
                              const std::function<bool(Index)>& accept, double reach) {
  std::vector<Index> all;
  for (Index i = 0; i < points.size(); ++i) {
    if ((!accept || accept(i)) && (points[i] - p).norm() <= reach) {
      all.push_back(i);
    }
  }
  std::stable_sort(all.begin(), all.end(),
                   [&](Index a, Index b) { return (points[a] - p).squaredNorm() < (points[b] - p).squaredNorm(); });
  all.resize(std::min(k, all.size()));
  return all;
}

TEST(PointTree, FindsWhatAFullSortFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const std::function<bool(Index)> even = [](Index i) { return i % 2 == 0; };
  for (const std::size_t count : {0u, 1u, 2u, 8u, 9u, 100u, 1000u}) {
    for (const double flatten : {1.0, 0.0}) {
      std::vector<Vec3> points;
      for (std::size_t i = 0; i < count; ++i) {
        points.emplace_back(uniform(random), uniform(random), flatten * uniform(random));
      }
      const PointTree tree(points);
      for (int i = 0; i < 50; ++i) {
        const Vec3 p(uniform(random), uniform(random), uniform(random));
        EXPECT_EQ(tree.nearest(p, 3), by_sorting(points, p, 3, {}, 1e9));
        EXPECT_EQ(tree.nearest(p, 5, even, 0.4), by_sorting(points, p, 5, even, 0.4));
      }
    }
  }
}

TEST(PointTree, OfEqualDistancesTheSmallerIndexComesFirst) {
  const std::vector<Vec3> points(40, Vec3(1, 2, 3));
  EXPECT_EQ(PointTree(points).nearest(Vec3(0, 0, 0), 3), (std::vector<Index>{0, 1, 2}));
}

TEST(PointTree, BesideALineIsWhatLiesWithinReachOfIt) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto point = [&] { return Vec3(uniform(random), uniform(random), uniform(random)); };
  for (const std::size_t count : {0u, 1u, 9u, 1000u}) {
    std::vector<Vec3> points(count);
    std::ranges::generate(points, point);
    const PointTree tree(points);
    for (int i = 0; i < 60; ++i) {
      const Vec3 from = point();
      // Along an axis and of no length, too.
      const Vec3 to = i % 3 == 0 ? Vec3(from + Vec3::UnitY()) : i % 3 == 1 ? point() : from;
      for (const double reach : {0.0, 0.1, 0.5}) {
        std::vector<Index> expected;
        for (Index v = 0; v < count; ++v) {
          const Vec3 way = to - from;
          const double at = way.isZero() ? 0 : std::clamp((points[v] - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
          if ((points[v] - from - at * way).norm() <= reach) {
            expected.push_back(v);
          }
        }
        EXPECT_EQ(tree.beside(from, to, reach), expected);
      }
    }
  }
}

TEST(PointTree, AsksForNoMoreThanThereAre) {
  EXPECT_EQ(PointTree({Vec3(0, 0, 0)}).nearest(Vec3(1, 1, 1), 3).size(), 1u);
  EXPECT_TRUE(PointTree({Vec3(0, 0, 0)}).nearest(Vec3(1, 1, 1), 0).empty());
}

}  // namespace
}  // namespace tunica
