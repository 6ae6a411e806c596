#include "tunica/surface/decimation/degenerate.hpp"

#include "surface/decimated.hpp"
#include "surface/shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

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

/// A sphere of n meridians whose poles are rings of n vertices in one place: to its triangles two holes.
TriangleMesh sphere_with_rings(std::size_t n, std::size_t m, double radius_of_rings = 0) {
  TriangleMesh mesh = shapes::tube(n, m);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Vec3& v = mesh.vertices[i];
    const std::size_t j = i / n;
    const double latitude = std::numbers::pi * (static_cast<double>(j) / static_cast<double>(m) - 0.5);
    const bool pole = j == 0 || j == m;
    v.head<2>() *= pole ? radius_of_rings : std::cos(latitude);
    v.z() = std::sin(latitude);
  }
  return mesh;
}

TEST(Degenerate, BoundaryLoopsThatAreAPointAreClosed) {
  for (const std::size_t n : {3U, 5U, 24U}) {
    const TriangleMesh mesh = sphere_with_rings(n, 12);
    ASSERT_EQ(count_degenerate(mesh), 2 * n);
    ASSERT_EQ(examine(mesh).euler, 0);
    const WithoutDegenerate clean = without_degenerate_triangles(mesh);
    EXPECT_EQ(clean.closed_loops, 2U);
    EXPECT_EQ(count_degenerate(clean.mesh), 0U);
    EXPECT_EQ(clean.mesh.triangles.size(), mesh.triangles.size() - 2 * n);
    EXPECT_EQ(clean.mesh.vertices.size(), mesh.vertices.size() - 2 * (n - 1));
    const MeshFacts after = examine(clean.mesh);
    EXPECT_FALSE(why_unfit(after)) << *why_unfit(after);
    EXPECT_TRUE(after.closed);
    EXPECT_EQ(after.euler, 2);
    EXPECT_LE(distance(clean.mesh, mesh), 1.1e-5 * diagonal(mesh));
  }
  DecimateOptions options;
  options.triangles = 60;
  const DecimateResult coarse = decimate(sphere_with_rings(24, 12), options);
  EXPECT_EQ(coarse.closed_loops, 2U);
  EXPECT_TRUE(examine(coarse.mesh).closed);
  EXPECT_EQ(count_degenerate(coarse.mesh), 0U);
}

TEST(Degenerate, RingsWithinEachOtherAreOnePoint) {
  // The next two parallels have shrunk to the pole as well.
  TriangleMesh mesh = sphere_with_rings(16, 12);
  for (std::size_t i = 16; i < 48; ++i) {
    mesh.vertices[i] = mesh.vertices[0];
  }
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(clean.closed_loops, 2U);
  EXPECT_EQ(count_degenerate(clean.mesh), 0U);
  EXPECT_EQ(examine(clean.mesh).euler, 2);
}

TEST(Degenerate, HolesWithAnExtentStayHoles) {
  const TriangleMesh mesh = sphere_with_rings(24, 12, 1e-6);
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(clean.closed_loops, 0U);
  expect_same_surface(clean.mesh, mesh);
  EXPECT_EQ(examine(clean.mesh).boundary_loops, 2U);
}

/// A sheet of one by one from whose side at x = 1 a chain of `count` triangles without area sticks out, 0.5 long.
TriangleMesh sheet_with_spike(Index count) {
  TriangleMesh mesh = shapes::plane(8, 8);
  // Its last edge at that side, from (1, 7/8) to (1, 1), and the rest on the line through it.
  Index last = 8 * 9 - 1, end = 9 * 9 - 1;
  for (Index i = 1; i <= count; ++i) {
    const auto tip = static_cast<Index>(mesh.vertices.size());
    mesh.vertices.emplace_back(1, 1 + 0.5 * static_cast<double>(i) / count, 0);
    mesh.triangles.push_back(i % 2 == 1 ? std::array<Index, 3>{end, last, tip} : std::array<Index, 3>{last, end, tip});
    last = end;
    end = tip;
  }
  return mesh;
}

TEST(Degenerate, SpikesGoAndTheirLengthIsTold) {
  for (const Index count : {1U, 2U, 7U}) {
    const TriangleMesh mesh = sheet_with_spike(count);
    ASSERT_FALSE(why_unfit(examine(mesh)));
    ASSERT_EQ(count_degenerate(mesh), count);
    const WithoutDegenerate clean = without_degenerate_triangles(mesh);
    EXPECT_EQ(count_degenerate(clean.mesh), 0U);
    EXPECT_EQ(clean.mesh.triangles.size(), 128U);
    EXPECT_NEAR(clean.longest_spike, 0.5, 1e-12);
    EXPECT_GE(clean.moved, clean.longest_spike);
    EXPECT_EQ(clean.long_spikes, 0U);
    EXPECT_EQ(examine(clean.mesh).euler, 1);
  }
}

TEST(Degenerate, WhatLiesOnTheBoundaryIsNoSpike) {
  TriangleMesh mesh = sheet_with_spike(1);
  mesh.vertices.back().y() = 0.9 + 1e-17;  // on the edge itself
  mesh.vertices.back().x() += 1e-16;
  const WithoutDegenerate clean = without_degenerate_triangles(mesh);
  EXPECT_EQ(count_degenerate(clean.mesh), 0U);
  EXPECT_EQ(clean.longest_spike, 0);
  EXPECT_LE(clean.moved, 1e-15);
}

TEST(Degenerate, SpikesThatAnErrorForbidsStay) {
  const TriangleMesh mesh = sheet_with_spike(3);
  const WithoutDegenerate kept = without_degenerate_triangles(mesh, 0.49);
  EXPECT_EQ(kept.mesh.triangles.size(), mesh.triangles.size());
  EXPECT_EQ(kept.long_spikes, 1U);
  EXPECT_EQ(kept.longest_spike, 0);
  EXPECT_EQ(kept.moved, 0);

  DecimateOptions options;
  options.max_error = 0.1;
  const DecimateResult with = decimate(mesh, options);
  EXPECT_TRUE(with.error_kept);
  EXPECT_EQ(with.long_spikes, 1U);
  EXPECT_LE(distance(with.mesh, mesh), 0.1 + 1.1e-5 * diagonal(mesh));
  options.max_error = 0.6;
  const DecimateResult without = decimate(mesh, options);
  EXPECT_TRUE(without.error_kept);
  EXPECT_EQ(count_degenerate(without.mesh), 0U);
  EXPECT_NEAR(without.longest_spike, 0.5, 1e-12);
  EXPECT_GE(without.error->upper, 0.5);
  EXPECT_LE(without.error->upper, 0.6);
  EXPECT_LE(distance(without.mesh, mesh), without.error->upper + 1.1e-5 * diagonal(mesh));
}

TEST(Degenerate, WhateverHangsOnABoundaryWithoutAreaGoes) {
  for (unsigned seed = 0; seed < 40; ++seed) {
    TriangleMesh mesh = shapes::plane(4, 4);
    std::mt19937 random(seed);
    for (int i = 0; i < 30; ++i) {
      const auto loop = boundary_loops(mesh)[0];
      const std::size_t k = random() % loop.size();
      const Index u = loop[k], v = loop[(k + 1) % loop.size()];
      // Along the edge: before it, at its first end, on it, beyond it.
      const double along = std::array<double, 4>{-0.7, 0, 0.4, 1.8}[random() % 4];
      mesh.triangles.push_back({v, u, static_cast<Index>(mesh.vertices.size())});
      mesh.vertices.push_back((1 - along) * mesh.vertices[u] + along * mesh.vertices[v]);
    }
    ASSERT_FALSE(why_unfit(examine(mesh)));
    ASSERT_GE(count_degenerate(mesh), 30U);
    const WithoutDegenerate clean = without_degenerate_triangles(mesh);
    const MeshFacts after = examine(clean.mesh);
    EXPECT_EQ(count_degenerate(clean.mesh), 0U) << "seed " << seed;
    EXPECT_FALSE(why_unfit(after)) << *why_unfit(after);
    EXPECT_EQ(after.euler, 1);
    EXPECT_EQ(after.boundary_loops, 1U);
    EXPECT_NEAR(area(clean.mesh), 1, 1e-9);
    EXPECT_LE(distance(clean.mesh, mesh), clean.moved + 1.1e-5 * diagonal(mesh)) << "seed " << seed;
  }
}

TEST(Degenerate, NecksAndPiecesWithoutAreaStay) {
  // Two sheets side by side, joined by two triangles along one line.
  const TriangleMesh two = shapes::together(shapes::plane(4, 4), shapes::moved(shapes::plane(4, 4), {2, 0, 0}));
  TriangleMesh neck = two;
  const Index a = 4, b = 9, c = 25, d = 30;  // (1, 0), (1, 1/4) and (2, 0), (2, 1/4)
  for (const Index v : {b, d}) {
    neck.vertices[v].y() = 0;  // both ends of the neck on the line y = 0
    neck.vertices[v].x() += v == b ? 0.1 : -0.1;
  }
  neck.triangles.push_back({b, a, c});
  neck.triangles.push_back({b, c, d});
  ASSERT_FALSE(why_unfit(examine(neck))) << *why_unfit(examine(neck));
  const WithoutDegenerate kept = without_degenerate_triangles(neck);
  EXPECT_EQ(count_degenerate(kept.mesh), 2U);
  const MeshFacts after = examine(kept.mesh);
  EXPECT_EQ(after.components, 1U);
  EXPECT_EQ(after.euler, examine(neck).euler);

  TriangleMesh line{{{5, 0, 0}, {6, 0, 0}, {7, 0, 0}, {8, 0, 0}}, {{{0, 1, 2}, {2, 1, 3}}}};
  const WithoutDegenerate piece = without_degenerate_triangles(shapes::together(two, line));
  EXPECT_EQ(examine(piece.mesh).components, 3U);
  EXPECT_GT(count_degenerate(piece.mesh), 0U);
  EXPECT_EQ(piece.longest_spike, 0);
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
