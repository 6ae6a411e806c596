#include "surface/degenerate.hpp"

#include "core/error.hpp"
#include "surface/checks.hpp"
#include "surface/decimated.hpp"
#include "surface/shapes.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

/// Puts a vertex on the first edge of a triangle, of this triangle alone: a cap closes the gap to the neighbour.
void add_cap(TriangleMesh& mesh, std::size_t triangle, double along) {
  const auto [u, v, w] = mesh.triangles[triangle];
  const auto m = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.push_back((1 - along) * mesh.vertices[u] + along * mesh.vertices[v]);
  mesh.triangles[triangle] = {u, m, w};
  mesh.triangles.push_back({m, v, w});
  mesh.triangles.push_back({u, v, m});
}

void expect_same_surface(const TriangleMesh& clean, const TriangleMesh& given) {
  const MeshFacts before = examine(given), after = examine(clean);
  EXPECT_FALSE(why_unfit(after)) << *why_unfit(after);
  EXPECT_EQ(after.euler, before.euler);
  EXPECT_EQ(after.components, before.components);
  EXPECT_EQ(after.closed, before.closed);
  EXPECT_NEAR(area(clean), area(given), 1e-9 * area(given));
  HausdorffOptions options;
  options.width = 1e-3 * diagonal(given);
  EXPECT_LE(hausdorff(clean, given, options).both.upper, options.width);
}

TEST(Degenerate, CapsAreFlippedAway) {
  TriangleMesh mesh = shapes::sphere(3);
  std::mt19937 random(7);
  for (int i = 0; i < 200; ++i) {
    add_cap(mesh, random() % 512, 0.1 + 0.8 * static_cast<double>(random() % 100) / 100);
  }
  ASSERT_EQ(count_degenerate(mesh), 200U);
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(count_degenerate(clean.mesh), 0U);
  EXPECT_EQ(clean.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_LT(clean.moved, 1e-12);
  expect_same_surface(clean.mesh, mesh);
}

TEST(Degenerate, PocketsOfCapsAreFlippedAway) {
  // Caps on both sides of an edge and on the edges of caps.
  for (unsigned seed = 0; seed < 20; ++seed) {
    TriangleMesh mesh = shapes::sphere(1);
    std::mt19937 random(seed);
    for (int i = 0; i < 60; ++i) {
      add_cap(mesh, random() % mesh.triangles.size(), 0.1 + 0.8 * static_cast<double>(random() % 100) / 100);
    }
    ASSERT_GE(count_degenerate(mesh), 60U);
    const WithoutDegenerate clean = without_degenerate_triangles(mesh);
    EXPECT_EQ(count_degenerate(clean.mesh), 0U) << "seed " << seed;
    expect_same_surface(clean.mesh, mesh);
  }
}

TEST(Degenerate, NeedlesCollapse) {
  TriangleMesh mesh = shapes::sphere(3);
  for (const std::size_t t : {10U, 100U, 200U, 300U}) {
    mesh.vertices[mesh.triangles[t][1]] = mesh.vertices[mesh.triangles[t][0]];
  }
  ASSERT_EQ(count_degenerate(mesh), 8U);
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(count_degenerate(clean.mesh), 0U);
  EXPECT_EQ(clean.mesh.triangles.size(), mesh.triangles.size() - 8);
  expect_same_surface(clean.mesh, mesh);
}

TEST(Degenerate, ACapAtABoundaryGoes) {
  TriangleMesh mesh = shapes::plane(4, 4);
  // On the edge from (0, 0) to (1/4, 0).
  const auto first = std::find_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& c) {
    return mesh.vertices[c[0]].y() == 0 && mesh.vertices[c[1]].y() == 0;
  });
  ASSERT_NE(first, mesh.triangles.end());
  add_cap(mesh, static_cast<std::size_t>(first - mesh.triangles.begin()), 0.5);
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(count_degenerate(clean.mesh), 0U);
  EXPECT_EQ(clean.mesh.triangles.size(), mesh.triangles.size() - 1);
  expect_same_surface(clean.mesh, mesh);
}

TEST(Degenerate, CopiesOfAVertexWithinEachOtherCollapseWhicheverEdgeComesFirst) {
  // A triangle put at a vertex, with all its corners in that place, and another one in that.
  for (unsigned first = 0; first < 3; ++first) {
    TriangleMesh mesh = shapes::sphere(1);
    for (int copies = 0; copies < 3; ++copies) {
      auto& triangle = mesh.triangles[first == 0 ? 0 : mesh.triangles.size() - 1];
      std::rotate(triangle.begin(), triangle.begin() + first, triangle.end());
      const auto [u, v, w] = triangle;
      const auto m = static_cast<Index>(mesh.vertices.size());
      mesh.vertices.push_back(mesh.vertices[u]);
      triangle = {u, v, m};
      mesh.triangles.push_back({v, w, m});
      mesh.triangles.push_back({w, u, m});
    }
    ASSERT_GE(count_degenerate(mesh), 3U);
    const WithoutDegenerate clean = without_degenerate_triangles(mesh);
    EXPECT_EQ(count_degenerate(clean.mesh), 0U);
    expect_same_surface(clean.mesh, mesh);
  }
}

TEST(Degenerate, NothingButDegenerateTrianglesIsRefused) {
  TriangleMesh mesh = shapes::sphere(1);
  for (Vec3& v : mesh.vertices) {
    v.y() = v.z() = 0;
  }
  DecimateOptions options;
  options.triangles = 10;
  EXPECT_THROW(decimate(mesh, options), InputError);
}

TEST(Degenerate, WhatIsSoundStaysAsItIs) {
  const TriangleMesh mesh = shapes::sphere(2);
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(clean.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_EQ(clean.moved, 0);
  expect_same_surface(clean.mesh, mesh);
}

TEST(Degenerate, DecimationLeavesNone) {
  TriangleMesh mesh = shapes::sphere(3);
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    add_cap(mesh, random() % mesh.triangles.size(), 0.3);
  }
  for (const std::size_t count : {700U, 650U, 300U, 100U}) {
    DecimateOptions options;
    options.triangles = count;
    const DecimateResult coarse = decimate(mesh, options);
    EXPECT_LE(coarse.mesh.triangles.size(), count);
    EXPECT_EQ(count_degenerate(coarse.mesh), 0U) << count;
  }
  DecimateOptions exact;
  exact.max_error = 1e-6;
  const DecimateResult same = decimate(mesh, exact);
  EXPECT_TRUE(same.error_kept);
  EXPECT_EQ(count_degenerate(same.mesh), 0U);
  EXPECT_LE(distance(same.mesh, mesh), 1e-6 + 1e-5 * diagonal(mesh));
  exact.min_angle = 20;
  EXPECT_EQ(count_degenerate(decimate(mesh, exact).mesh), 0U);
}

}  // namespace
}  // namespace tunica
