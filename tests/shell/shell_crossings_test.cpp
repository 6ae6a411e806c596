#include "shell/shell_crossings.hpp"

#include "shell/curved_surface.hpp"
#include "shell/families.hpp"
#include "surface/self_intersections.hpp"
#include "surface/shapes.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <random>

namespace tunica {
namespace {

using Pairs = std::vector<std::array<Index, 2>>;
using testing::sphere_shell;

/// An independent look: both patches drawn by level^2 triangles each, every triangle of one against every other. What
/// touches the node that they share is left out.
bool drawings_cross(const ShellMesh& shell, Index one, Index other, int level) {
  const auto drawn = [&](Index t) {
    ShellMesh alone = shell;
    alone.triangles = {shell.triangles[t]};
    if (!shell.corner_normals.empty()) {
      alone.corner_normals = {shell.corner_normals[t]};
    }
    return tessellate_uniformly(alone, level).mesh;
  };
  const TriangleMesh a = drawn(one), b = drawn(other);
  std::vector<Vec3> nodes;
  for (const Index v : shell.triangles[one]) {
    for (const Index w : shell.triangles[other]) {
      if (v == w) {
        nodes.push_back(shell.vertices[v]);
      }
    }
  }
  const auto corners = [](const TriangleMesh& mesh, std::size_t t) {
    const auto& [i, j, k] = mesh.triangles[t];
    return std::array<Vec3, 3>{mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]};
  };
  const auto has_node = [&](const std::array<Vec3, 3>& c) {
    return std::find_first_of(c.begin(), c.end(), nodes.begin(), nodes.end()) != c.end();
  };
  for (std::size_t i = 0; i < a.triangles.size(); ++i) {
    for (std::size_t j = 0; j < b.triangles.size(); ++j) {
      const auto c = corners(a, i), d = corners(b, j);
      if (!(has_node(c) && has_node(d)) && triangles_cross(c, d)) {
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
  ShellMesh shell = sphere_shell(2);
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
  std::size_t beside_node = 0, strangers = 0;
  for (const Patch patch : {Patch::comas, Patch::watertight}) {
    for (const std::uint32_t seed : {1U, 2U}) {
      const ShellMesh shell = disordered(patch, 0.25, 0.5, seed);
      const Pairs found = crossing_patches(shell);
      EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
      for (Index i = 0; i < shell.triangles.size(); ++i) {
        for (Index j = i + 1; j < shell.triangles.size(); ++j) {
          const std::size_t shared = shared_nodes(shell, i, j);
          if (shared > 1) {
            continue;
          }
          const bool is_found = std::binary_search(found.begin(), found.end(), std::array<Index, 2>{i, j});
          // Where two drawings disagree the patches do no more than graze each other.
          const bool coarse = drawings_cross(shell, i, j, 9);
          if (coarse == is_found) {
            (shared == 0 ? strangers : beside_node) += is_found ? 1 : 0;
            continue;
          }
          EXPECT_EQ(drawings_cross(shell, i, j, 40), is_found) << i << ' ' << j << " share " << shared;
        }
      }
    }
  }
  EXPECT_GT(strangers, 20U);
  EXPECT_GT(beside_node, 20U);
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
