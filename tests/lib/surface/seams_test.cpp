#include "tunica/surface/mesh/seams.hpp"

#include "surface/shapes.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/repair/repair.hpp"

#include <gtest/gtest.h>

#include <random>

namespace tunica {
namespace {

/// The sphere's halves with vertices of their own, these moved by about so much.
TriangleMesh glued_sphere(double radius, double moved, bool turned = false) {
  TriangleMesh mesh = shapes::sphere(3, radius);
  const auto count = static_cast<Index>(mesh.vertices.size());
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 1);
  for (Index v = 0; v < count; ++v) {
    mesh.vertices.emplace_back(mesh.vertices[v] + moved * Vec3(noise(random), noise(random), noise(random)));
  }
  for (auto& t : mesh.triangles) {
    if ((mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]]).z() < 0) {
      t = {t[0] + count, t[1] + count, t[2] + count};
      if (turned) {
        std::swap(t[1], t[2]);
      }
    }
  }
  return without_unused(std::move(mesh));
}

/// The upper half is cut twice as finely, its vertices half way along the lower half's edges.
TriangleMesh half_split_sphere() {
  const TriangleMesh coarse = shapes::sphere(3, 10);
  TriangleMesh above{coarse.vertices, {}}, below{coarse.vertices, {}};
  for (const auto& t : coarse.triangles) {
    const double z = (coarse.vertices[t[0]] + coarse.vertices[t[1]] + coarse.vertices[t[2]]).z();
    (z > 0 ? above : below).triangles.push_back(t);
  }
  return without_unused(shapes::together(shapes::split(above), below));
}

TEST(Seams, ThereAreNoneWhereNothingCoincides) {
  for (const TriangleMesh& mesh : {shapes::sphere(3), shapes::tube(12, 5), shapes::plane(4, 3)}) {
    EXPECT_EQ(find_seams(mesh).edges, 0U);
    EXPECT_EQ(without_seams(mesh).mesh.triangles, mesh.triangles);
  }
  // A slit wider than a hundredth of its edges is a slit.
  EXPECT_EQ(find_seams(glued_sphere(10, 0.1)).edges, 0U);
}

TEST(Seams, GluedHalvesAreFoundAndJoined) {
  for (const double moved : {0.0, 1e-6, 1e-3}) {
    for (const bool turned : {false, true}) {
      const TriangleMesh mesh = glued_sphere(10, moved, turned);
      const Seams seams = find_seams(mesh);
      EXPECT_EQ(seams.edges, examine(mesh).boundary_edges);
      EXPECT_EQ(seams.whole_edges, seams.edges);
      EXPECT_EQ(seams.t_junctions, 0U);
      EXPECT_NEAR(seams.place.z(), 0, 1e-3);
      const Repaired whole = repaired(mesh);
      const MeshFacts facts = examine(whole.mesh);
      EXPECT_TRUE(facts.closed && facts.manifold && facts.oriented);
      EXPECT_EQ(facts.euler, 2);
      EXPECT_EQ(whole.repairs.joined_edges, seams.edges);
      EXPECT_EQ(whole.mesh.triangles.size(), mesh.triangles.size());
      EXPECT_NEAR(std::abs(signed_volume(whole.mesh)), signed_volume(shapes::sphere(3, 10)), 0.1);
    }
  }
}

TEST(Seams, TJunctionsAreFoundAndTheirLongEdgesSplit) {
  const TriangleMesh mesh = half_split_sphere();
  const MeshFacts given = examine(mesh);
  const Seams seams = find_seams(mesh);
  EXPECT_EQ(3 * seams.t_junctions, given.boundary_edges);  // two short edges to each long one
  EXPECT_EQ(seams.edges, given.boundary_edges);
  EXPECT_EQ(seams.whole_edges, 0U);
  EXPECT_NEAR(seams.t_place.z(), 0, 1e-9);
  const Repaired whole = repaired(mesh);
  const MeshFacts facts = examine(whole.mesh);
  EXPECT_TRUE(facts.closed && facts.manifold && facts.oriented);
  EXPECT_EQ(facts.euler, 2);
  EXPECT_EQ(whole.repairs.split_edges, seams.t_junctions);
  EXPECT_EQ(facts.triangles, given.triangles + seams.t_junctions);
  EXPECT_NEAR(signed_volume(whole.mesh), signed_volume(shapes::sphere(3, 10)), 1e-9);
}

TEST(Seams, EdgesThatOverlapInPartsAreSplitOnBothSides) {
  // Two strips of a square whose common side is cut at 0.3 and 0.7 by one, at 0.5 by the other.
  const TriangleMesh mesh{
      {{0, 0, 0}, {0.3, 0, 0}, {0.7, 0, 0}, {1, 0, 0}, {0.5, 1, 0}, {0, 0, 0}, {0.5, 0, 0}, {1, 0, 0}, {0.5, -1, 0}},
      {{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {6, 5, 8}, {7, 6, 8}}}};
  const Repaired whole = repaired(mesh);
  const MeshFacts facts = examine(whole.mesh);
  EXPECT_EQ(facts.components, 1U);
  EXPECT_EQ(facts.boundary_edges, 4U);
  EXPECT_EQ(facts.boundary_loops, 1U);
  EXPECT_NEAR(area(whole.mesh), area(mesh), 1e-12);
}

}  // namespace
}  // namespace tunica
