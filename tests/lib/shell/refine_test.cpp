#include "tunica/shell/patch/refine.hpp"

#include "shell/families.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

std::vector<Split> all(const ShellMesh& shell, Split split) {
  return std::vector<Split>(shell.triangles.size(), split);
}

TEST(Refine, AllEdgesMakeFourOfEachAndKeepTheSphere) {
  const ShellMesh shell = testing::sphere_shell(1);
  const ShellMesh finer = split_shells(shell, all(shell, Split::all_edges));
  EXPECT_EQ(finer.triangles.size(), 4 * shell.triangles.size());
  const MeshFacts facts = examine(flat_facets(finer));
  EXPECT_TRUE(facts.manifold && facts.oriented && facts.closed);
  EXPECT_EQ(facts.euler, 2);
  EXPECT_NO_THROW(require_fit(finer, "finer"));
  // New nodes lie on the curved surface, far closer to the sphere than the edges' middles.
  for (const Vec3& p : finer.vertices) {
    EXPECT_NEAR(p.norm(), 1, 0.004);
  }
}

TEST(Refine, OneSplitShellKeepsTheMeshConforming) {
  for (const Split split : {Split::longest_edge, Split::all_edges}) {
    const TriangleMesh mesh = testing::cylinder(7, 3, 1, 2);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      ShellMesh shell{mesh.vertices, mesh.triangles, {}, {}, Patch::comas};
      for (const Vec3& p : mesh.vertices) {
        shell.normals.emplace_back(p.x(), p.y(), 0);
      }
      std::vector<Split> wanted(mesh.triangles.size(), Split::none);
      wanted[t] = split;
      const ShellMesh finer = split_shells(shell, wanted);
      const MeshFacts facts = examine(flat_facets(finer));
      EXPECT_TRUE(facts.manifold && facts.oriented);
      EXPECT_EQ(facts.euler, 0);
      EXPECT_EQ(facts.boundary_loops, 2u);
      EXPECT_GT(finer.triangles.size(), mesh.triangles.size());
    }
  }
}

TEST(Refine, NothingWantedLeavesTheMeshAsItIs) {
  const ShellMesh shell = testing::sphere_shell(1);
  const ShellMesh same = split_shells(shell, all(shell, Split::none));
  EXPECT_EQ(same.vertices, shell.vertices);
  EXPECT_EQ(same.triangles.size(), shell.triangles.size());
}

TEST(Refine, RepeatedLocalSplitsDoNotWearTheAnglesDown) {
  ShellMesh shell = testing::sphere_shell(1);
  const double before = min_angle_degrees(flat_facets(shell));
  for (int i = 0; i < 8; ++i) {
    std::vector<Split> wanted(shell.triangles.size(), Split::none);
    wanted[0] = wanted[1] = Split::longest_edge;
    shell = split_shells(shell, wanted);
  }
  EXPECT_GT(min_angle_degrees(flat_facets(shell)), before / 2 - 1);
}

TEST(Refine, KeepsToTheLimitOfShellsAndSplitsTheWorstFirst) {
  const ShellMesh shell = testing::sphere_shell(2);
  std::vector<double> errors(shell.triangles.size(), 0.5);
  errors[17] = 100;
  for (const std::size_t most : {320u, 325u, 340u, 500u, 100000u}) {
    const ShellMesh finer = refine_where(shell, errors, 0.1, most);
    EXPECT_LE(finer.triangles.size(), most);
    EXPECT_TRUE(examine(flat_facets(finer)).manifold);
    if (most >= 340) {
      EXPECT_GT(finer.triangles.size(), shell.triangles.size());
    }
  }
  EXPECT_EQ(refine_where(shell, errors, 1000, 100000).triangles.size(), shell.triangles.size());
}

}  // namespace
}  // namespace tunica
