#include "tunica/shell/patch/patch_lanes.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <random>

namespace tunica {
namespace {

/// The parameters of the point of the facet closest to q, brought inside.
Vec2 foot_on_facet(const CubicPatch& patch, const Vec3& q) {
  const auto& c = patch.control;
  Eigen::Matrix<double, 3, 2> edges;
  edges << c[1] - c[0], c[2] - c[0];
  Vec2 at = (edges.transpose() * edges).inverse() * (edges.transpose() * (q - c[0]));
  at = at.cwiseMax(0);
  return at.sum() > 1 ? Vec2(at / at.sum()) : at;
}

CubicPatch some_patch() {
  return comas_patch({Vec3(0, 0, 0), Vec3(2, 0, 0.1), Vec3(0.4, 1.5, -0.2)},
                     {Vec3(-0.3, -0.2, 1).normalized(), Vec3(0.3, -0.1, 1).normalized(), Vec3(0, 0.3, 1).normalized()});
}

Vec3 lane(const LaneVec3& points, std::size_t k) { return {points[0][k], points[1][k], points[2][k]}; }

TEST(PatchLanes, PowersAreThePatch) {
  const CubicPatch patch = some_patch();
  const PatchPowers powers(patch);
  const PatchAxes axes(patch);
  const std::array<Vec2, lane_count> places{Vec2(0, 0), Vec2(0.2, 0.3), Vec2(1, 0), Vec2(0.1, 0.9)};
  const Lanes x = lanes_of([&](std::size_t k) { return places[k][0]; });
  const Lanes y = lanes_of([&](std::size_t k) { return places[k][1]; });
  const LaneVec3 points = powers.point(x, y);
  const auto tangents = powers.tangents(x, y);
  for (std::size_t k = 0; k < lane_count; ++k) {
    const Lanes point = axes.point(places[k]);
    const auto along = axes.tangents(places[k]);
    const auto second = axes.second_derivatives(places[k]);
    const auto expected_along = patch.tangents(places[k]);
    const auto expected_second = patch.second_derivatives(places[k]);
    EXPECT_LT((lane(points, k) - patch.point(places[k])).norm(), 1e-14);
    EXPECT_LT((Vec3(point[0], point[1], point[2]) - patch.point(places[k])).norm(), 1e-14);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_LT((lane(tangents[i], k) - expected_along[i]).norm(), 1e-13);
      EXPECT_LT((Vec3(along[i][0], along[i][1], along[i][2]) - expected_along[i]).norm(), 1e-13);
    }
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_LT((Vec3(second[i][0], second[i][1], second[i][2]) - expected_second[i]).norm(), 1e-12);
    }
  }
}

TEST(PatchLanes, FeetAreThoseOfOnePointAtATime) {
  const CubicPatch patch = some_patch();
  const PatchPowers powers(patch);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> coordinate(-1, 2.5);
  for (int i = 0; i < 500; ++i) {
    std::array<Vec3, lane_count> q;
    for (Vec3& p : q) {
      p = {coordinate(random), coordinate(random), coordinate(random)};
    }
    const LaneFeet feet = feet_on_patch(powers, lane_points([&](std::size_t k) { return q[k]; }));
    for (std::size_t k = 0; k < lane_count; ++k) {
      const PatchFoot expected = foot_on_patch(PatchAxes(patch), q[k], foot_on_facet(patch, q[k]), 2);
      const Vec2 at(feet.x[k], feet.y[k]);
      EXPECT_LT((at - expected.at).norm(), 1e-9);
      EXPECT_NEAR(feet.squared_distance[k], expected.squared_distance, 1e-12);
      EXPECT_LT((lane(feet.point, k) - patch.point(at)).norm(), 1e-13);
    }
  }
}

}  // namespace
}  // namespace tunica
