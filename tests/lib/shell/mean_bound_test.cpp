#include "tunica/shell/distance/mean_bound.hpp"

#include "shell/families.hpp"
#include "tunica/shell/distance/shell_distance.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

TEST(MeanBound, OfConcentricSpheresIsTheirDistance) {
  const ShellMesh inner = testing::sphere_shell(2, 10);
  for (const double gap : {0.01, 0.1, 1.0}) {
    const Target outer(testing::sphere(5, 10 + gap));
    const double mean = mean_distance(inner, outer).first;
    const double bound = mean_distance_bound(inner, outer, 0.1 * gap);
    EXPECT_GE(bound, mean);
    EXPECT_LT(bound, 1.2 * gap + 0.01);  // the facets of the outer one lie up to 0.006 below it
    EXPECT_GT(bound, 0.9 * gap - 0.01);
  }
}

TEST(MeanBound, GetsCloserWithTheSlackAndCountsBothWays) {
  const ShellMesh ball = testing::sphere_shell(2, 10);
  const TriangleMesh whole = testing::sphere(4, 10);
  TriangleMesh half = whole;
  std::erase_if(half.triangles, [&](const auto& t) { return whole.vertices[t[0]].z() < 0; });
  // The lower half of the ball is far from the upper one; that one is near to the ball.
  const Target target(half);
  const double mean = mean_distance(ball, target).first;
  double before = infinity;
  for (const double slack : {1.0, 0.1, 0.01}) {
    const double bound = mean_distance_bound(ball, target, slack);
    EXPECT_LE(bound, before + 1e-9);
    EXPECT_GE(bound, mean - 0.02);  // the mean is sampled
    EXPECT_LT(bound, mean + 1.5 * slack + 0.02);
    before = bound;
  }
  EXPECT_GT(mean, 1);
}

}  // namespace
}  // namespace tunica
