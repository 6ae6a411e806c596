#include "tunica/shell/distance/shell_crossings.hpp"

#include "shell/families.hpp"
#include "surface/shapes.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <random>

namespace tunica {
namespace {

using Pairs = std::vector<std::array<Index, 2>>;
using testing::sphere_shell;

/// A patch drawn by level^2 triangles, with their boxes.
struct Drawing {
  std::vector<std::array<Vec3, 3>> triangles;
  std::vector<Vec3> lower, upper;

  Drawing(const ShellMesh& shell, Index patch, int level) {
    ShellMesh alone = shell;
    alone.triangles = {shell.triangles[patch]};
    const TriangleMesh mesh = tessellate_uniformly(alone, level).mesh;
    for (const auto& [i, j, k] : mesh.triangles) {
      const auto& c = triangles.emplace_back(std::array{mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]});
      lower.push_back(c[0].cwiseMin(c[1]).cwiseMin(c[2]));
      upper.push_back(c[0].cwiseMax(c[1]).cwiseMax(c[2]));
    }
  }
};

/// An independent look: both patches drawn, every triangle of one against every other but for those two that
/// have a common node.
bool drawings_cross(const ShellMesh& shell, Index one, Index other, int level) {
  const Drawing a(shell, one, level), b(shell, other, level);
  for (std::size_t i = 0; i < a.triangles.size(); ++i) {
    for (std::size_t j = 0; j < b.triangles.size(); ++j) {
      if ((a.lower[i].array() > b.upper[j].array()).any() || (b.lower[j].array() > a.upper[i].array()).any()) {
        continue;
      }
      const auto &c = a.triangles[i], &d = b.triangles[j];
      const bool at_node = std::find_first_of(c.begin(), c.end(), d.begin(), d.end()) != c.end();
      if (!at_node && triangles_cross(c, d)) {
        return true;
      }
    }
  }
  return false;
}

std::size_t shared_nodes(const ShellMesh& shell, Index one, Index other) {
  std::size_t shared = 0;
  for (const Index v : shell.triangles[one]) {
    for (const Index w : shell.triangles[other]) {
      shared += v == w ? 1 : 0;
    }
  }
  return shared;
}

/// A ball of shells whose nodes and normals are so much at odds that patches run through one another.
ShellMesh disordered(Patch patch, double place, double normal, std::uint32_t seed) {
  ShellMesh shell = sphere_shell(1);
  shell.patch = patch;
  std::mt19937 random(seed);
  const auto unit = [&] { return 2 * static_cast<double>(random()) / 4294967295.0 - 1; };
  const auto any = [&] { return Vec3(unit(), unit(), unit()); };
  for (std::size_t v = 0; v < shell.vertices.size(); ++v) {
    shell.vertices[v] += place * any();
    shell.normals[v] = (shell.normals[v] + normal * any()).normalized();
  }
  return shell;
}

TEST(ShellCrossings, AreThoseThatAFineDrawingShows) {
  std::size_t beside_node = 0, strangers = 0, grazing = 0;
  for (const Patch patch : {Patch::comas, Patch::watertight}) {
    for (const std::uint32_t seed : {1U, 2U, 3U}) {
      const ShellMesh shell = disordered(patch, 0.45, 0.6, seed);
      const Pairs found = crossing_patches(shell);
      EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
      for (Index i = 0; i < shell.triangles.size(); ++i) {
        for (Index j = i + 1; j < shell.triangles.size(); ++j) {
          const std::size_t shared = shared_nodes(shell, i, j);
          const bool drawn = shared < 2 && drawings_cross(shell, i, j, 10);
          const bool is_found = std::binary_search(found.begin(), found.end(), std::array<Index, 2>{i, j});
          if (shared > 1 || (!drawn && !is_found)) {
            continue;
          }
          // Where two drawings disagree the patches do no more than graze each other. Close to a common node, where
          // both have one tangent plane, nearly all that overlap do.
          if (drawn != drawings_cross(shell, i, j, 40)) {
            continue;
          }
          if (shared == 0) {
            EXPECT_EQ(is_found, drawn) << i << ' ' << j;
            ++strangers;
          } else {
            ++(is_found == drawn ? beside_node : grazing);
          }
        }
      }
    }
  }
  EXPECT_GT(strangers, 20U);
  EXPECT_GT(beside_node, 20U);
  EXPECT_LT(grazing, beside_node);
}

TEST(ShellCrossings, SmoothShellsHaveNone) {
  for (const Patch patch : {Patch::comas, Patch::watertight}) {
    for (const int level : {0, 1, 3}) {
      ShellMesh ball = sphere_shell(level);
      ball.patch = patch;
      EXPECT_EQ(crossing_patches(ball), Pairs{});
    }
    EXPECT_EQ(crossing_patches(disordered(patch, 0.02, 0.05, 3)), Pairs{});
  }
}

TEST(ShellCrossings, CurvedPatchesCrossWhereTheirFacetsDoNot) {
  // A bulge of a patch reaches through the flat one above it. Without its normals there is nothing.
  ShellMesh shell;
  shell.vertices = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 0.3}, {4, 0, 0.3}, {0, 4, 0.3}};
  shell.triangles = {{0, 1, 2}, {3, 4, 5}};
  shell.normals.assign(6, Vec3(0, 0, 1));
  EXPECT_EQ(crossing_patches(shell), Pairs{});
  for (std::size_t v = 0; v < 3; ++v) {
    shell.normals[v] = (Vec3(0, 0, 1) + 0.5 * (shell.vertices[v] - Vec3(4.0 / 3, 4.0 / 3, 0))).normalized();
  }
  for (const Patch patch : {Patch::comas, Patch::watertight}) {
    shell.patch = patch;
    EXPECT_EQ(crossing_patches(shell), (Pairs{{0, 1}}));
  }
}

TEST(ShellCrossings, APatchFoldedOverItsEdgeIntoItsNeighbourIsOne) {
  // Two facets at an edge, the angle between them half a degree; one bulges through the other.
  ShellMesh shell;
  shell.vertices = {{0, 0, 0}, {4, 0, 0}, {2, 3, 0}, {2, 3, 0.03}};
  shell.triangles = {{0, 1, 2}, {1, 0, 3}};
  shell.normals.assign(4, Vec3(0, 0, 1));
  const Vec3 up(0, 0, 1), down(0, 0, -1);
  shell.corner_normals = {{up, up, up}, {down, down, down}};
  shell.patch = Patch::watertight;
  EXPECT_EQ(crossing_patches(shell), Pairs{});
  const Vec3 centre(2, 1, 0);
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 out = 0.3 * (shell.vertices[shell.triangles[0][k]] - centre);
    shell.corner_normals[0][k] = (up + out).normalized();
  }
  EXPECT_EQ(crossing_patches(shell), (Pairs{{0, 1}}));
}

}  // namespace
}  // namespace tunica
