#include "tunica/shell/distance/boundary_distance.hpp"

#include "shell/families.hpp"
#include "tunica/shell/distance/shell_distance.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace tunica {
namespace {

/// A square of 10 by 10 in squares of `cell`, but for those where `missing(x, y)` of their middle.
template <typename Missing>
TriangleMesh sheet(double cell, const Missing& missing, double x0 = 0) {
  const int n = static_cast<int>(std::lround(10 / cell));
  TriangleMesh mesh;
  std::map<std::pair<int, int>, Index> number;
  const auto at = [&](int i, int j) {
    const auto [found, is_new] = number.try_emplace({i, j}, static_cast<Index>(mesh.vertices.size()));
    if (is_new) {
      mesh.vertices.emplace_back(x0 + cell * i, cell * j, 0);
    }
    return found->second;
  };
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      if (!missing(cell * (i + 0.5), cell * (j + 0.5))) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return mesh;
}

bool nowhere(double, double) { return false; }

std::optional<BoundaryDistance> measured(const TriangleMesh& shells, const TriangleMesh& target, double width) {
  return boundary_distance(boundary_curves(testing::flat_shells(shells, Patch::comas)), Target(target), width);
}

TEST(BoundaryDistance, OfAShiftedSheetIsTheShift) {
  for (const double width : {0.1, 1e-3, 1e-6}) {
    const auto found = measured(sheet(5, nowhere, 0.25), sheet(1, nowhere), width);
    ASSERT_TRUE(found);
    EXPECT_LE(found->both.lower, 0.25);
    EXPECT_GE(found->both.upper, 0.25);
    EXPECT_LE(found->both.upper - found->both.lower, width + 1e-9);
  }
}

TEST(BoundaryDistance, ALoopThatIsAPointIsNoBoundaryOfATarget) {
  // A cone whose tip is a ring of vertices in one place, and the same with one vertex there.
  const int around = 16;
  TriangleMesh cone = testing::cylinder(around, 4, 1, 2);
  for (Vec3& v : cone.vertices) {
    v.head<2>() *= (2 - v.z()) / 2;
  }
  const Target target(cone);
  EXPECT_EQ(target.point_loops(), 1U);
  ASSERT_EQ(target.boundary().size(), 1U);
  ASSERT_EQ(target.boundary_vertices().size(), 1U);
  EXPECT_EQ(target.boundary_vertices()[0].size(), 16U);
  EXPECT_EQ(target.boundary_tree()->closest({0, 0, 2}).point.z(), 0);
  TriangleMesh closed = cone;
  const auto tip = static_cast<Index>(4 * around);
  for (auto& c : closed.triangles) {
    for (Index& v : c) {
      v = std::min(v, tip);
    }
  }
  std::erase_if(closed.triangles, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
  closed.vertices.resize(tip + 1);
  EXPECT_EQ(Target(closed).point_loops(), 0U);
}

TEST(BoundaryDistance, SeesABayThatTheSurfacesDoNot) {
  const auto bay = [](double x, double y) { return x > 4.9 && x < 5.1 && y > 5; };
  const TriangleMesh with_bay = sheet(0.1, bay), filled = sheet(5, nowhere);
  ShellDistanceOptions measuring;
  measuring.width = 1e-3;
  EXPECT_LE(shell_distance(testing::flat_shells(filled, Patch::comas), Target(with_bay), measuring).both.upper, 0.102);
  // Its bottom is 5 below the top and as far from either side, but for half its width.
  const auto found = measured(filled, with_bay, 1e-3);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->target_to_shell.lower, 5, 2e-3);
  EXPECT_NEAR(found->target_to_shell.upper, 5, 2e-3);
  EXPECT_NEAR(found->shell_to_target.upper, 0.1, 2e-3);
  EXPECT_NEAR((found->farthest[1] - Vec3(5, 5, 0)).norm(), 0, 0.11);
  // The other way round the bay is the shells'.
  const auto other = measured(with_bay, filled, 1e-3);
  ASSERT_TRUE(other);
  EXPECT_NEAR(other->shell_to_target.lower, 5, 2e-3);
  EXPECT_NEAR(other->target_to_shell.lower, 0.1, 2e-3);
}

TEST(BoundaryDistance, OfCurvedEdgesHoldsWhatSamplesSay) {
  for (const int around : {4, 6, 12}) {
    const TriangleMesh coarse = testing::cylinder(around, 2, 10, 20);
    ShellMesh shell = testing::flat_shells(coarse, Patch::comas);
    for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Vec3& p = shell.vertices[shell.triangles[t][k]];
        shell.corner_normals[t][k] = Vec3(p.x(), p.y(), 0).normalized();
      }
    }
    const TriangleMesh fine = testing::cylinder(5000, 1, 10, 20);
    const std::vector<CubicCurve> curves = boundary_curves(shell);
    EXPECT_EQ(curves.size(), static_cast<std::size_t>(2 * around));
    double sampled = 0;
    for (const CubicCurve& curve : curves) {
      for (int i = 0; i <= 1000; ++i) {
        const Vec3 p = point_on(curve, i / 1000.0);
        const double beyond = std::min(std::abs(p.z()), std::abs(p.z() - 20));
        sampled = std::max(sampled, std::hypot(std::hypot(p.x(), p.y()) - 10, beyond));
      }
    }
    ASSERT_GT(sampled, 1e-4);
    const auto found = boundary_distance(curves, Target(fine), 1e-5);
    ASSERT_TRUE(found);
    // The polygon of 5,000 is 2e-6 within the circle.
    EXPECT_GE(found->both.upper, sampled - 2e-6);
    EXPECT_LE(found->both.lower, sampled + 2e-6);
    EXPECT_LE(found->both.upper - found->both.lower, 1.1e-5);
  }
}

TEST(BoundaryDistance, IsNoneWhereOneIsClosed) {
  EXPECT_FALSE(measured(testing::sphere(1), sheet(1, nowhere), 1e-3));
  EXPECT_FALSE(measured(sheet(1, nowhere), testing::sphere(1), 1e-3));
}

TEST(BoundaryDistance, ALimitThatIsMissedIsSeenSo) {
  const auto curves = boundary_curves(testing::flat_shells(sheet(5, nowhere, 0.25), Patch::comas));
  const Target target(sheet(0.1, nowhere));
  EXPECT_GT(boundary_distance(curves, target, 1e-3, 0.24)->both.upper, 0.24);
  EXPECT_LE(boundary_distance(curves, target, 1e-3, 0.26)->both.upper, 0.26);
}

}  // namespace
}  // namespace tunica
