#include "tunica/shell/distance/normals.hpp"

#include "shell/families.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <random>

namespace tunica {
namespace {

double agreement(const Vec3& n, const std::vector<Vec3>& others) {
  double least = 1;
  for (const Vec3& o : others) {
    least = std::min(least, n.dot(o));
  }
  return least;
}

TEST(Normals, MostCompatibleOneBeatsEveryOtherDirection) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const std::size_t count : {1u, 2u, 3u, 6u, 40u}) {
    for (int trial = 0; trial < 20; ++trial) {
      std::vector<Vec3> fan;
      for (std::size_t i = 0; i < count; ++i) {
        fan.push_back((Vec3(0.7 * normal(random), 0.7 * normal(random), 1)).normalized());
      }
      const CompatibleNormal best = most_compatible_normal(fan);
      EXPECT_NEAR(best.normal.norm(), 1, 1e-12);
      EXPECT_NEAR(best.agreement, agreement(best.normal, fan), 1e-12);
      for (int i = 0; i < 200; ++i) {
        const Vec3 other = (best.normal + 0.2 * Vec3(normal(random), normal(random), normal(random))).normalized();
        EXPECT_LE(agreement(other, fan), best.agreement + 1e-9);
      }
    }
  }
}

TEST(Normals, CompatibleOneIsTheWantedOneWhereItMayBeAndOnTheLimitElsewhere) {
  const std::vector<Vec3> fan{Vec3(0.6, 0, 0.8), Vec3(-0.6, 0, 0.8), Vec3(0, 0.6, 0.8)};
  const Vec3 inside = Vec3(0.05, 0.1, 1).normalized();
  EXPECT_EQ(*compatible_normal(inside, fan, 0.5), inside);
  const Vec3 outside = Vec3(0.1, 0, -1).normalized();
  EXPECT_NEAR(agreement(*compatible_normal(outside, fan, 0.5), fan), 0.5, 1e-9);
}

TEST(Normals, NoNormalSuitsFacetsFoldedBeyondTheLimitAndOneDoesJustWithinIt) {
  // Two facets whose normals are 2 a apart: the best normal agrees with both by cos a.
  for (const double agreed : {0.199, 0.201}) {
    const double a = std::acos(agreed);
    const std::vector<Vec3> fan{Vec3(std::sin(a), 0, std::cos(a)), Vec3(-std::sin(a), 0, std::cos(a))};
    EXPECT_EQ(compatible_normal(Vec3::UnitZ(), fan, least_normal_agreement).has_value(), agreed > 0.2);
  }
}

TEST(Normals, FacetsThatFaceOppositeWaysHaveNone) {
  EXPECT_LE(most_compatible_normal(std::vector<Vec3>{Vec3::UnitX(), -Vec3::UnitX()}).agreement, 0);
}

ShellMesh bare(const TriangleMesh& mesh) { return {mesh.vertices, mesh.triangles, {}, {}, Patch::comas}; }

TEST(Normals, OfASphereAreItsRadii) {
  const Target target(testing::sphere(5));
  ShellMesh shell = bare(testing::sphere(2));
  EXPECT_TRUE(take_normals_from(target, shell).empty());
  for (std::size_t v = 0; v < shell.vertices.size(); ++v) {
    EXPECT_LT((shell.normals[v] - shell.vertices[v]).norm(), 0.01);
  }
}

}  // namespace
}  // namespace tunica
