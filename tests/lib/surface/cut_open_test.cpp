#include "tunica/surface/mesh/cut_open.hpp"

#include "surface/shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr double pi = std::numbers::pi;

/// A tube along z from 0 to `length`, its ends closed by fans, normals outward.
TriangleMesh closed_tube(double radius, double length, std::size_t around, std::size_t along) {
  TriangleMesh mesh = shapes::tube(around, along, radius, length);
  const auto bottom = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.emplace_back(0, 0, 0);
  mesh.vertices.emplace_back(0, 0, length);
  const auto last = static_cast<Index>(along * around);
  for (std::size_t i = 0; i < around; ++i) {
    const auto a = static_cast<Index>(i);
    const auto b = static_cast<Index>((i + 1) % around);
    mesh.triangles.push_back({bottom, b, a});
    mesh.triangles.push_back(
        {static_cast<Index>(bottom + 1), static_cast<Index>(last + a), static_cast<Index>(last + b)});
  }
  return mesh;
}

/// Whatever the place of the plane: two flat rims, the area of what is left, no sliver, normals as before.
TEST(CutOpen, LeavesFlatRims) {
  const TriangleMesh tube = closed_tube(10, 40, 24, 20);
  for (const double place : {20.0, 20.3, 20.999, 21.0, 21.9999999}) {
    const TriangleMesh below = cut_open(tube, Vec3::UnitZ(), place);
    const TriangleMesh middle = cut_open(below, -Vec3::UnitZ(), -5.7);
    const MeshFacts facts = examine(middle);
    EXPECT_TRUE(facts.manifold && facts.oriented) << place;
    EXPECT_FALSE(facts.closed);
    EXPECT_EQ(facts.euler, 0);
    const auto rims = boundary_loops(middle);
    ASSERT_EQ(rims.size(), 2U);
    for (const auto& rim : rims) {
      const double z = middle.vertices[rim.front()].z() > 10 ? place : 5.7;
      for (const Index v : rim) {
        EXPECT_NEAR(middle.vertices[v].z(), z, 1e-12);
      }
    }
    EXPECT_NEAR(area(middle), 48 * 10 * std::sin(pi / 24) * (place - 5.7), 0.02 * area(middle));
    EXPECT_GT(min_angle_degrees(middle), 8) << place;
    for (const auto& t : middle.triangles) {
      const Vec3& a = middle.vertices[t[0]];
      const Vec3 normal = (middle.vertices[t[1]] - a).cross(middle.vertices[t[2]] - a);
      EXPECT_GT(normal.dot(Vec3(a.x(), a.y(), 0)), 0);
    }
  }
}

TEST(CutOpen, PartsWhatMeetsAtAPoint) {
  // Two tetrahedra without a face each, whose tips meet in the plane.
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, -1}, {2, 1, -1}, {-1, 0, -1}, {-2, 1, -1}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 4, 3}, {0, 1, 5}};
  const TriangleMesh cut = cut_open(mesh, Vec3::UnitZ(), 0);
  EXPECT_EQ(cut.triangles.size(), 3U);
  EXPECT_TRUE(examine(cut).manifold);
  EXPECT_EQ(examine(cut).components, 2U);
}

TEST(CutOpen, AllOrNothing) {
  const TriangleMesh tube = closed_tube(10, 40, 12, 10);
  EXPECT_TRUE(cut_open(tube, Vec3::UnitZ(), -1).triangles.empty());
  EXPECT_EQ(cut_open(tube, Vec3::UnitZ(), 41).triangles, tube.triangles);
  EXPECT_THROW(cut_open(tube, Vec3::Zero(), 1), InputError);
  EXPECT_THROW(cut_open(tube, Vec3::UnitZ(), std::nan("")), InputError);
}

}  // namespace
}  // namespace tunica
