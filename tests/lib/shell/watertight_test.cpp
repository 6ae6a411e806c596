#include "tunica/shell/patch/tessellate_conforming.hpp"

#include "shell/families.hpp"
#include "shell/gaps.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/shell/distance/curved_hausdorff.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace tunica {
namespace {

using testing::corner_at;
using testing::largest_gap;
using testing::sphere_shell;

ShellMesh watertight(ShellMesh shell) {
  shell.patch = Patch::watertight;
  return shell;
}

/// A ball with dents, and normals that follow nothing in particular.
/// @param crease  how far apart the normals of the corners at one node are, roughly
ShellMesh rough_ball(int times, double crease) {
  ShellMesh shell = watertight(sphere_shell(times));
  for (std::size_t i = 0; i < shell.vertices.size(); ++i) {
    const double k = static_cast<double>(i);
    shell.vertices[i] *= 1 + 0.1 * std::sin(3 * k);
    shell.normals[i] = (shell.normals[i] + 0.3 * Vec3(std::sin(k), std::cos(2 * k), std::sin(5 * k))).normalized();
  }
  for (std::size_t t = 0; crease > 0 && t < shell.triangles.size(); ++t) {
    std::array<Vec3, 3> normals;
    for (std::size_t i = 0; i < 3; ++i) {
      const double k = 3.3 * static_cast<double>(3 * t + i);
      normals[i] = (shell.normals[shell.triangles[t][i]] + crease * Vec3(std::cos(k), std::sin(3 * k), std::sin(k)))
                       .normalized();
    }
    shell.corner_normals.push_back(normals);
  }
  return shell;
}

TEST(Watertight, NeighboursMeetExactlyWhateverTheNormals) {
  for (const double crease : {0.0, 0.01, 0.1, 0.4}) {
    ShellMesh shell = rough_ball(1, crease);
    const auto [gap, edges] = largest_gap(shell);
    EXPECT_EQ(edges, 120U);
    EXPECT_LT(gap, 2e-15) << crease;
    shell.patch = Patch::comas;
    EXPECT_GT(largest_gap(shell).first, 1e-2) << crease;
  }
}

TEST(Watertight, PatchTouchesTheCornersWithTheGivenNormalsAlsoAtACrease) {
  const ShellMesh smooth = rough_ball(1, 0);
  const auto patches = curved_patches(smooth);
  for (std::size_t t = 0; t < patches.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_LT((patches[t].point(corner_at[k]) - smooth.vertices[smooth.triangles[t][k]]).norm(), 1e-14);
      EXPECT_LT((patches[t].normal(corner_at[k]) - smooth.normal(t, static_cast<int>(k))).norm(), 1e-12);
    }
  }
  // Two facets that meet at 90 degrees, the edge bowed in both of their surfaces.
  ShellMesh roof{{{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2}, {1, 0, 3}}, {}, {}, Patch::watertight};
  const double tilt = 0.3;
  roof.corner_normals = {{Vec3(-tilt, 0, 1), Vec3(tilt, 0, 1), Vec3(0, 0, 1)},
                         {Vec3(tilt, 1, 0), Vec3(-tilt, 1, 0), Vec3(0, 1, 0)}};
  for (auto& normals : roof.corner_normals) {
    for (Vec3& n : normals) {
      n.normalize();
    }
  }
  const auto creased = curved_patches(roof);
  for (std::size_t t = 0; t < 2; ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_LT((creased[t].normal(corner_at[k]) - roof.corner_normals[t][k]).norm(), 1e-12);
    }
  }
  EXPECT_LT(largest_gap(roof).first, 1e-15);
  EXPECT_GT((creased[0].point({0.5, 0})).norm(), 0.1);
}

TEST(Watertight, DoesNotDependOnTheOrderOfTheVertices) {
  ShellMesh shell = rough_ball(1, 0.3);
  const auto before = curved_patches(shell);
  for (std::size_t t = 0; t < shell.triangles.size(); ++t) {
    std::rotate(shell.triangles[t].begin(), shell.triangles[t].begin() + 1, shell.triangles[t].end());
    std::rotate(shell.corner_normals[t].begin(), shell.corner_normals[t].begin() + 1, shell.corner_normals[t].end());
  }
  const auto after = curved_patches(shell);
  for (std::size_t t = 0; t < before.size(); ++t) {
    for (const Vec2& p : {Vec2(0.2, 0.3), Vec2(0.7, 0.1), Vec2(0, 0.4)}) {
      EXPECT_LT((before[t].point(p) - after[t].point({p[1], 1 - p[0] - p[1]})).norm(), 1e-14);
    }
  }
}

TEST(Watertight, APlaneIsKeptAndFlatFacetsStayFlat) {
  const Vec3 n = Vec3(1, 2, 3).normalized();
  const std::array<Vec3, 3> corners{Vec3(0, 0, 0), 3 * n.unitOrthogonal(), n.cross(n.unitOrthogonal())};
  const CubicPatch patch = smooth_patch(Patch::watertight, corners, {n, n, n});
  for (const Vec2& b : {Vec2(0.2, 0.3), Vec2(0.5, 0.5), Vec2(1.0 / 3, 1.0 / 3)}) {
    EXPECT_LT((patch.point(b) - (b[0] * corners[1] + b[1] * corners[2])).norm(), 1e-15);
  }
  // A normal per facet: every edge is a crease, and straight.
  ShellMesh facets = watertight(sphere_shell(1));
  for (const Vec3& normal : facet_normals(flat_facets(facets))) {
    facets.corner_normals.push_back({normal, normal, normal});
  }
  const auto patches = curved_patches(facets);
  for (std::size_t t = 0; t < patches.size(); ++t) {
    EXPECT_LT(flatness(patches[t], 1), 1e-15);
  }
}

TEST(Watertight, QuadraticSurfacesAreMetToTheFourthOrder) {
  // z = (x^2 + 0.5 x y - 0.3 y^2) over ever smaller triangles at its apex: what is left is of the next order.
  double before = 0;
  for (const double h : {0.1, 0.05, 0.025}) {
    const auto at = [&](double x, double y) { return Vec3(x, y, x * x + 0.5 * x * y - 0.3 * y * y); };
    const auto up = [&](double x, double y) { return Vec3(-2 * x - 0.5 * y, -0.5 * x + 0.6 * y, 1).normalized(); };
    const std::array<Vec2, 3> p{Vec2(0, 0), Vec2(h, 0.1 * h), Vec2(0.3 * h, 0.9 * h)};
    std::array<Vec3, 3> corners, normals;
    for (std::size_t i = 0; i < 3; ++i) {
      corners[i] = at(p[i][0], p[i][1]);
      normals[i] = up(p[i][0], p[i][1]);
    }
    const CubicPatch patch = smooth_patch(Patch::watertight, corners, normals);
    double worst = 0;
    for (int i = 0; i <= 12; ++i) {
      for (int j = 0; i + j <= 12; ++j) {
        const Vec3 x = patch.point({i / 12.0, j / 12.0});
        worst = std::max(worst, std::abs(x.z() - at(x.x(), x.y()).z()));
      }
    }
    if (before > 0) {
      EXPECT_GT(std::log2(before / worst), 3.6) << h;
    }
    before = worst;
  }
}

TEST(Watertight, EdgesOfACircleAreMetToTheSixthOrder) {
  const auto error = [](double angle) {
    const Vec3 a(1, 0, 0), b(std::cos(angle), std::sin(angle), 0);
    const Vec3 p = watertight_edge_point(a, b, {a, a}), q = watertight_edge_point(b, a, {b, b});
    double worst = 0;
    for (int i = 0; i <= 64; ++i) {
      const double s = i / 64.0, r = 1 - s;
      worst =
          std::max(worst, std::abs((r * r * r * a + 3 * r * r * s * p + 3 * r * s * s * q + s * s * s * b).norm() - 1));
    }
    return worst;
  };
  EXPECT_LT(error(std::numbers::pi / 2), 3e-4);
  EXPECT_NEAR(std::log2(error(1) / error(0.5)), 6, 0.2);
}

/// From a smooth edge to a crease nothing jumps.
TEST(Watertight, EdgesFollowTheirNormalsSteadily) {
  const Vec3 here(0, 0, 0), there(1, 0.2, 0.1);
  double largest = 0;
  Vec3 before = Vec3::Zero();
  for (int i = 0; i <= 6000; ++i) {
    const double angle = 2.0 * i / 6000;
    const Vec3 a(0.1, 0.05, 1), b(0.15, std::sin(angle), std::cos(angle));
    const Vec3 p = watertight_edge_point(here, there, {a.normalized(), b.normalized()});
    EXPECT_EQ(p, watertight_edge_point(here, there, {b.normalized(), a.normalized()}));  // from the other side too
    if (i > 0) {
      largest = std::max(largest, (p - before).norm());
    }
    before = p;
  }
  EXPECT_LT(largest, 3e-3);
}

double sphere_error(int times, Patch patch) {
  ShellMesh shell = sphere_shell(times);
  shell.patch = patch;
  double worst = 0;
  for (const Vec3& p : tessellate_uniformly(shell, 12).mesh.vertices) {
    worst = std::max(worst, std::abs(p.norm() - 1));
  }
  return worst;
}

double cylinder_error(int around, int along, Patch patch) {
  const TriangleMesh mesh = testing::cylinder(around, along, 1, 2);
  ShellMesh shell{mesh.vertices, mesh.triangles, {}, {}, patch};
  for (const Vec3& p : mesh.vertices) {
    shell.normals.emplace_back(p.x(), p.y(), 0);
  }
  double worst = 0;
  for (const Vec3& p : tessellate_uniformly(shell, 12).mesh.vertices) {
    worst = std::max(worst, std::abs(std::hypot(p.x(), p.y()) - 1));
  }
  return worst;
}

TEST(Watertight, ErrorFallsAtLeastWithTheThirdPowerOfTheSizeAndIsNoLargerThanThePapers) {
  for (int times = 1; times <= 3; ++times) {
    const double rate = std::log2(sphere_error(times, Patch::watertight) / sphere_error(times + 1, Patch::watertight));
    EXPECT_GT(rate, 3.2) << times;
    EXPECT_LT(rate, 5) << times;
    EXPECT_LT(sphere_error(times, Patch::watertight), 0.9 * sphere_error(times, Patch::comas)) << times;
  }
  for (const int around : {8, 16}) {
    const double rate = std::log2(cylinder_error(around, around / 2, Patch::watertight) /
                                  cylinder_error(2 * around, around, Patch::watertight));
    EXPECT_GT(rate, 3.2) << around;
    EXPECT_LT(rate, 5) << around;
    EXPECT_LT(cylinder_error(around, around / 2, Patch::watertight),
              0.9 * cylinder_error(around, around / 2, Patch::comas))
        << around;
  }
}

/// A closed cylinder of radius 1, z in [0, 2]; normals per corner at its rims, or one per node halfway.
ShellMesh capped_cylinder(int around, bool creased) {
  const TriangleMesh side = testing::cylinder(around, 2, 1, 2);
  ShellMesh shell{side.vertices, side.triangles, {}, {}, Patch::watertight};
  const auto n = static_cast<Index>(around);
  const Index bottom = 3 * n, top = bottom + 1;
  shell.vertices.emplace_back(0, 0, 0);
  shell.vertices.emplace_back(0, 0, 2);
  for (Index i = 0; i < n; ++i) {
    shell.triangles.push_back({bottom, (i + 1) % n, i});
    shell.triangles.push_back({top, 2 * n + i, 2 * n + (i + 1) % n});
  }
  for (const Vec3& p : shell.vertices) {
    const Vec3 out(p.x(), p.y(), 0), along(0, 0, p.z() - 1);
    shell.normals.push_back((out + along).normalized());
  }
  for (std::size_t t = 0; creased && t < shell.triangles.size(); ++t) {
    const bool cap = t >= side.triangles.size();
    std::array<Vec3, 3> normals;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& p = shell.vertices[shell.triangles[t][k]];
      normals[k] = cap ? Vec3(0, 0, p.z() - 1) : Vec3(p.x(), p.y(), 0).normalized();
    }
    shell.corner_normals.push_back(normals);
  }
  return shell;
}

double capped_error(const ShellMesh& shell) {
  double worst = 0;
  for (const Vec3& p : tessellate_uniformly(shell, 12).mesh.vertices) {
    const double beside = std::abs(std::hypot(p.x(), p.y()) - 1), beyond = std::abs(std::abs(p.z() - 1) - 1);
    worst = std::max(worst, std::min(beside, beyond));
  }
  return worst;
}

TEST(Watertight, NormalsPerCornerKeepTheRimsOfAClosedCylinder) {
  for (const int around : {8, 16}) {
    const ShellMesh shell = capped_cylinder(around, true);
    EXPECT_NO_THROW(require_fit(shell, "x.ply"));
    EXPECT_LT(largest_gap(shell).first, 2e-15);
    EXPECT_LT(capped_error(shell), 1.05 * cylinder_error(around, 2, Patch::watertight));  // the rims add nothing
    EXPECT_GT(capped_error(capped_cylinder(around, false)), 20 * capped_error(shell));
    const double exact = 2 * std::numbers::pi;
    EXPECT_NEAR(curved_volume(shell), exact, 6e-3 * std::pow(8.0 / around, 4) * exact);
  }
}

/// Leaves numbers that are none where the next function has its variables.
[[gnu::noinline]] void spoil_the_stack() {
  std::array<volatile double, 4096> numbers;
  for (volatile double& number : numbers) {
    number = std::numeric_limits<double>::quiet_NaN();
  }
}

/// Edges that do not have two triangles of opposite direction.
std::size_t open_edges(const TriangleMesh& mesh) {
  std::map<std::array<Index, 2>, int> runs;
  for (const auto& v : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::array<Index, 2> edge{v[k], v[(k + 1) % 3]};
      ++runs[edge];
      --runs[{edge[1], edge[0]}];
    }
  }
  return narrow<std::size_t>(std::ranges::count_if(runs, [](const auto& run) { return run.second != 0; }));
}

TEST(Watertight, ConformingTrianglesCloseAClosedShellWithinTheDeviation) {
  for (const double crease : {0.0, 0.3}) {
    ShellMesh shell = rough_ball(1, crease);
    for (const double deviation : {0.1, 1e-2, 1e-3, 1e-4}) {
      const TriangleMesh mesh = tessellate_conforming(shell, deviation);
      EXPECT_EQ(open_edges(mesh), 0U);
      ShellDistanceOptions options;
      options.width = 0.2 * deviation;
      EXPECT_LT(curved_hausdorff(shell, Target(mesh), options).both.lower, deviation);
      EXPECT_NEAR(signed_volume(mesh), curved_volume(shell), 10 * deviation);
      const Tessellation open = tessellate(shell, deviation);
      EXPECT_GT(open_edges(open.mesh), 0U);
      if (deviation < 1e-2) {  // else the fewest pieces that have a vertex inside decide
        EXPECT_LT(real(mesh.triangles.size()), 2 * real(open.mesh.triangles.size()));
      }
    }
    EXPECT_THROW(tessellate_conforming(shell, 1e-4, 10'000), RequirementError);
    shell.patch = Patch::comas;
    EXPECT_THROW(tessellate_conforming(shell, 1e-2), InputError);
  }
}

TEST(Watertight, ConformingTrianglesOfAnOpenShellEndAtItsBoundary) {
  ShellMesh shell = watertight(sphere_shell(1));
  shell.triangles.resize(30);
  const TriangleMesh mesh = tessellate_conforming(shell, 1e-3);
  const TriangleMesh flat = flat_facets(shell);
  std::size_t boundary = 0;
  for (const auto& loop : boundary_loops(mesh)) {
    boundary += loop.size();
  }
  EXPECT_EQ(boundary, open_edges(mesh) / 2);
  EXPECT_EQ(boundary_loops(mesh).size(), boundary_loops(flat).size());
}

TEST(Watertight, VolumeDoesNotDependOnWhatWasInMemory) {
  const ShellMesh shell = watertight(sphere_shell(1));
  spoil_the_stack();
  EXPECT_TRUE(std::isfinite(curved_volume(shell)));
}

TEST(Watertight, VolumeIsThatOfAFineTessellationAndDoesNotDependOnTheOrigin) {
  for (const double crease : {0.0, 0.3}) {
    ShellMesh shell = rough_ball(1, crease);
    const auto by_pieces = [&](int level) { return signed_volume(tessellate_uniformly(shell, level).mesh); };
    const double fine = by_pieces(40), coarse = by_pieces(20);
    const double volume = curved_volume(shell);
    EXPECT_NEAR(volume, fine + (fine - coarse) / 3, 1e-6);  // the cut into pieces errs as level^-2
    for (Vec3& p : shell.vertices) {
      p += Vec3(1000, -2000, 500);
    }
    EXPECT_NEAR(curved_volume(shell), volume, 1e-11 * volume);
    shell.triangles.pop_back();
    if (crease > 0) {
      shell.corner_normals.pop_back();
    }
    EXPECT_THROW(curved_volume(shell), InputError);
  }
  const double exact = 4 * std::numbers::pi / 3;
  const auto error = [&](int times) { return std::abs(curved_volume(watertight(sphere_shell(times))) - exact); };
  EXPECT_GT(std::log2(error(1) / error(2)), 3.5);
  EXPECT_LT(error(3), 2e-5 * exact);
}

}  // namespace
}  // namespace tunica
