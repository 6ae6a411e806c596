#include "tunica/surface/repair/repair.hpp"

#include "surface/shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/seams.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

void expect_fit(const TriangleMesh& mesh) { EXPECT_EQ(why_unfit(examine(mesh)).value_or(""), ""); }

void expect_same_place(const TriangleMesh& a, const TriangleMesh& b) {
  HausdorffOptions options;
  options.width = 1e-6 * diagonal(b);
  options.samples = 0;
  EXPECT_LE(hausdorff(a, b, options).both.upper, 1.1e-6 * diagonal(b));
}

TEST(Repair, ASoundMeshComesBackAsItIs) {
  for (const TriangleMesh& mesh : {shapes::sphere(3), shapes::torus(20, 10), shapes::tube(12, 5)}) {
    const Repaired result = repaired(mesh);
    EXPECT_TRUE(result.repairs.none());
    EXPECT_EQ(result.mesh.triangles, mesh.triangles);
    EXPECT_EQ(result.mesh.vertices.size(), mesh.vertices.size());
  }
}

TEST(Repair, DoubleAndDegenerateTrianglesGo) {
  TriangleMesh mesh = shapes::sphere(2);
  mesh.triangles.push_back(mesh.triangles[5]);
  mesh.triangles.push_back({mesh.triangles[6][1], mesh.triangles[6][0], mesh.triangles[6][2]});
  mesh.triangles.push_back({3, 3, 7});
  mesh.vertices.emplace_back(std::nan(""), 0, 0);
  mesh.triangles.push_back({3, 4, static_cast<Index>(mesh.vertices.size() - 1)});
  const Repaired result = repaired(mesh);
  EXPECT_EQ(result.repairs.dropped_triangles, 4U);
  EXPECT_EQ(result.mesh.triangles, shapes::sphere(2).triangles);
  expect_fit(result.mesh);
}

TEST(Repair, TurnedTrianglesFaceTheirNeighboursWay) {
  TriangleMesh mesh = shapes::sphere(3);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3) {
    std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
  }
  const Repaired result = repaired(mesh);
  EXPECT_EQ(result.repairs.turned_triangles, (mesh.triangles.size() + 2) / 3);
  EXPECT_GT(signed_volume(result.mesh), 4);
  EXPECT_TRUE(examine(result.mesh).closed);
  expect_fit(result.mesh);
}

TEST(Repair, AFinLeavesTheSphereClosed) {
  TriangleMesh mesh = shapes::sphere(2);
  mesh.vertices.push_back(2 * mesh.vertices[mesh.triangles[0][0]]);
  mesh.triangles.push_back({mesh.triangles[0][0], mesh.triangles[0][1], static_cast<Index>(mesh.vertices.size() - 1)});
  const Repaired result = repaired(mesh);
  expect_fit(result.mesh);
  const MeshFacts facts = examine(result.mesh);
  EXPECT_EQ(facts.components, 2U);
  EXPECT_EQ(facts.boundary_edges, 3U);
  EXPECT_EQ(facts.triangles, mesh.triangles.size());
  expect_same_place(result.mesh, mesh);
}

TEST(Repair, CubesThatTouchAtAnEdgeOrACornerComeApart) {
  const TriangleMesh cube{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}},
                          {{{0, 2, 1},
                            {1, 2, 3},
                            {4, 5, 6},
                            {5, 7, 6},
                            {0, 1, 4},
                            {1, 5, 4},
                            {2, 6, 3},
                            {3, 6, 7},
                            {0, 4, 2},
                            {2, 4, 6},
                            {1, 3, 5},
                            {3, 7, 5}}}};
  for (const Vec3& by : {Vec3(1, 1, 0), Vec3(1, 1, 1)}) {
    TriangleMesh mesh = cube;
    std::map<Index, Index> same;
    for (Index v = 0; v < 8; ++v) {
      const Vec3 p = cube.vertices[v] + by;
      const auto it = std::find_if(cube.vertices.begin(), cube.vertices.end(), [&](const Vec3& q) { return p == q; });
      same[v] = static_cast<Index>(it != cube.vertices.end() ? it - cube.vertices.begin()
                                                             : static_cast<std::ptrdiff_t>(mesh.vertices.size()));
      if (it == cube.vertices.end()) {
        mesh.vertices.push_back(p);
      }
    }
    for (const auto& [i, j, k] : cube.triangles) {
      mesh.triangles.push_back({same[i], same[j], same[k]});
    }
    ASSERT_FALSE(examine(mesh).manifold);
    const Repaired result = repaired(mesh);
    expect_fit(result.mesh);
    EXPECT_TRUE(examine(result.mesh).closed);
    EXPECT_NEAR(signed_volume(result.mesh), 2, 1e-12);
    expect_same_place(result.mesh, mesh);
  }
}

TEST(Repair, AMoebiusStripIsCutOpenOnce) {
  TriangleMesh mesh;
  constexpr Index n = 24;
  for (Index i = 0; i < n; ++i) {
    const double u = 2 * std::numbers::pi * i / n;
    for (const double side : {-0.4, 0.4}) {
      const double r = 2 + side * std::cos(u / 2);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), side * std::sin(u / 2));
    }
  }
  for (Index i = 0; i < n; ++i) {
    const bool last = i + 1 == n;
    const Index a = 2 * i, b = 2 * i + 1, c = last ? 1 : 2 * i + 2, d = last ? 0 : 2 * i + 3;
    mesh.triangles.push_back({a, c, d});
    mesh.triangles.push_back({a, d, b});
  }
  ASSERT_FALSE(examine(mesh).oriented);
  const Repaired result = repaired(mesh);
  expect_fit(result.mesh);
  EXPECT_EQ(result.repairs.opened_edges, 1U);
  expect_same_place(result.mesh, mesh);
}

TEST(Repair, AnyTrianglesBecomeFit) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    // Few vertices, many triangles between them at random: every kind of bad connectivity at once.
    std::mt19937 random(seed);
    TriangleMesh mesh;
    const Index vertices = 4 + random() % 12;
    for (Index v = 0; v < vertices; ++v) {
      mesh.vertices.emplace_back(random() % 1000, random() % 1000, random() % 1000);
    }
    for (int t = 0; t < 40; ++t) {
      mesh.triangles.push_back({static_cast<Index>(random() % vertices), static_cast<Index>(random() % vertices),
                                static_cast<Index>(random() % vertices)});
    }
    const Repaired result = repaired(mesh);
    expect_fit(result.mesh);
    EXPECT_NEAR(area(result.mesh), area(repaired(result.mesh).mesh), 1e-9 * area(mesh));
    // Edges that could not agree lie on each other, and are looked at again.
    EXPECT_TRUE(find_seams(result.mesh).edges > 0 || repaired(result.mesh).repairs.none());
    expect_fit(repaired(result.mesh).mesh);
  }
}

TEST(Repair, PiecesWithoutAreaGoAndNeedlesWithinAPieceStay) {
  // Two triangles and a cap between them, a piece of two collinear triangles, and one that is a point.
  const TriangleMesh mesh{{{0, 0, 0},
                           {2, 0, 0},
                           {1, 1, 0},
                           {1, 0, 0},
                           {1, -1, 0},
                           {5, 0, 0},
                           {6, 0, 0},
                           {7, 0, 0},
                           {8, 0, 0},
                           {9, 9, 9},
                           {9, 9, 9},
                           {9, 9, 9}},
                          {{{0, 1, 2}}, {{0, 3, 1}}, {{0, 4, 3}}, {{5, 6, 7}}, {{7, 6, 8}}, {{9, 10, 11}}}};
  const Repaired result = repaired(mesh);
  EXPECT_EQ(result.mesh.triangles.size(), 3U);
  EXPECT_EQ(result.mesh.vertices.size(), 5U);
  EXPECT_EQ(result.repairs.dropped_triangles, 3U);
}

TEST(Repair, NothingLeftIsSaid) { EXPECT_THROW(repaired({{{0, 0, 0}, {1, 0, 0}}, {{{0, 1, 1}}}}), InputError); }

}  // namespace
}  // namespace tunica
