#include "tunica/shell/distance/curved_hausdorff.hpp"

#include "shell/families.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/hausdorff.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace tunica {
namespace {

/// Rough shells: normals tilted this way and that, so that patches bulge and gape.
ShellMesh rough_shell(int times, double tilt, double move) {
  ShellMesh shell = testing::sphere_shell(times);
  for (std::size_t v = 0; v < shell.vertices.size(); ++v) {
    const double a = 3.7 * static_cast<double>(v);
    shell.normals[v] = (shell.normals[v] + tilt * Vec3(std::sin(a), std::cos(1.3 * a), std::sin(2.1 * a))).normalized();
    shell.vertices[v] *= 1 + move * std::sin(5.3 * a);
  }
  return shell;
}

/// The other way to the same: flat triangles so fine that the deviation hardly matters.
HausdorffResult by_tessellation(const ShellMesh& shell, const TriangleMesh& target, double width) {
  const Tessellation fine = tessellate(shell, width / 8);
  HausdorffOptions options;
  options.width = width / 2;
  options.deviation_a = fine.deviation;
  options.samples = 100'000;
  return hausdorff(fine.mesh, target, options);
}

void expect_agreement(const ShellMesh& shell, const TriangleMesh& mesh, double part) {
  const Target target(mesh);
  ShellDistanceOptions options;
  options.width = part * target.diagonal();
  options.with_mean = true;
  const ShellDistance found = curved_hausdorff(shell, target, options);
  const HausdorffResult other = by_tessellation(shell, mesh, options.width);
  for (const auto& [one, two] : {std::pair(found.shell_to_target, other.a_to_b),
                                 {found.target_to_shell, other.b_to_a},
                                 {found.both, other.both}}) {
    EXPECT_LE(one.lower, two.upper);
    EXPECT_GE(one.upper, two.lower);
    EXPECT_LE(one.upper - one.lower, 1.3 * options.width);
  }
  // The tessellation itself is off by at most an eighth of the width.
  EXPECT_NEAR(found.mean, other.mean, 0.01 * other.mean + options.width / 8);
  EXPECT_NEAR(found.rms, other.rms, 0.01 * other.rms + options.width / 8);
}

TEST(CurvedHausdorff, AgreesWithAFineTessellation) {
  for (const double part : {1e-2, 1e-3, 1e-4}) {
    expect_agreement(rough_shell(1, 0.1, 0), testing::sphere(4), part);
    expect_agreement(rough_shell(2, 0.3, 0.05), testing::sphere(4), part);
  }
}

TEST(CurvedHausdorff, OpenShellsAndTargetsCoarserThanTheShells) {
  ShellMesh open = rough_shell(2, 0.1, 0.02);
  open.triangles.resize(open.triangles.size() - 20);
  for (const double part : {1e-2, 1e-3}) {
    expect_agreement(open, testing::sphere(4), part);
    expect_agreement(rough_shell(3, 0.05, 0), testing::sphere(1), part);
    // A normal per corner: neighbours gape widely.
    ShellMesh creased = rough_shell(1, 0, 0);
    for (std::size_t t = 0; t < creased.triangles.size(); ++t) {
      for (int k = 0; k < 3; ++k) {
        const double a = 2.9 * static_cast<double>(3 * t) + k;
        creased.corner_normals.resize(t + 1);
        creased.corner_normals[t][static_cast<std::size_t>(k)] =
            (creased.normals[creased.triangles[t][static_cast<std::size_t>(k)]] +
             0.2 * Vec3(std::sin(a), std::cos(a), std::sin(2 * a)))
                .normalized();
      }
    }
    expect_agreement(creased, testing::sphere(4), part);
  }
}

TEST(CurvedHausdorff, WatertightPatchesAgreeWithAFineTessellationToo) {
  for (const double part : {1e-2, 1e-3, 1e-4}) {
    ShellMesh shell = rough_shell(2, 0.3, 0.05);
    shell.patch = Patch::watertight;
    expect_agreement(shell, testing::sphere(4), part);
    shell.triangles.resize(shell.triangles.size() - 20);
    expect_agreement(shell, testing::sphere(4), part);
    ShellMesh creased = rough_shell(1, 0.1, 0);
    creased.patch = Patch::watertight;
    for (std::size_t t = 0; t < creased.triangles.size(); ++t) {
      std::array<Vec3, 3> normals;
      for (int k = 0; k < 3; ++k) {
        const double a = 2.9 * static_cast<double>(3 * t) + k;
        normals[static_cast<std::size_t>(k)] = (creased.normals[creased.triangles[t][static_cast<std::size_t>(k)]] +
                                                0.4 * Vec3(std::sin(a), std::cos(a), std::sin(2 * a)))
                                                   .normalized();
      }
      creased.corner_normals.push_back(normals);
    }
    expect_agreement(creased, testing::sphere(4), part);
  }
}

TEST(CurvedHausdorff, SpikeOfTheTargetIsFoundWhicheverSideItIs) {
  TriangleMesh spiked = testing::sphere(4);
  spiked.vertices[77] *= 1.5;
  const Target target(spiked);
  ShellDistanceOptions options;
  options.width = 1e-4 * target.diagonal();
  const ShellMesh shell = testing::sphere_shell(2);
  const ShellDistance found = curved_hausdorff(shell, target, options);
  EXPECT_LE(found.target_to_shell.lower, 0.5 + 1e-3);
  EXPECT_GE(found.target_to_shell.upper, 0.5 - 1e-3);
  EXPECT_LT(found.shell_to_target.upper, 0.1);
}

TEST(CurvedHausdorff, AllPatchesBeyondALimitAreListed) {
  TriangleMesh spiked = testing::sphere(4);
  const std::vector<Index> spikes{77, 500, 1400};
  for (const Index v : spikes) {
    spiked.vertices[v] *= 1.5;
  }
  const Target target(spiked);
  ShellMesh shell = testing::sphere_shell(2);
  for (const Index v : {Index{5}, Index{90}}) {
    shell.vertices[v] *= 0.6;
  }
  ShellDistanceOptions options;
  options.width = 1e-3;
  options.limit = 0.2;
  options.list_beyond = true;
  const ShellDistance found = curved_hausdorff(shell, target, options);
  EXPECT_GT(found.both.lower, 0.2);
  for (const Index v : spikes) {
    EXPECT_TRUE(std::any_of(found.beyond_of_target.begin(), found.beyond_of_target.end(),
                            [&](const FarPlace& place) { return (place.point - spiked.vertices[v]).norm() < 0.35; }));
  }
  for (const Index v : {Index{5}, Index{90}}) {
    EXPECT_TRUE(std::any_of(found.beyond_of_shell.begin(), found.beyond_of_shell.end(), [&](const FarPlace& place) {
      const auto& corners = shell.triangles[place.patch];
      return std::find(corners.begin(), corners.end(), v) != corners.end();
    }));
  }
  const std::vector<CubicPatch> patches = curved_patches(shell);
  std::set<Index> listed;
  for (const FarPlace& place : found.beyond_of_shell) {
    EXPECT_TRUE(listed.insert(place.patch).second) << "one of each patch";
    EXPECT_LT((patches[place.patch].point(place.at) - place.point).norm(), 1e-12);
    EXPECT_GT(std::sqrt(target.tree().closest(place.point).squared_distance), 0.19);
  }
  const Tessellation fine = tessellate(shell, 1e-3);
  const ClosestPoint tree(fine.mesh);
  for (const FarPlace& place : found.beyond_of_target) {
    EXPECT_GT(std::sqrt(tree.closest(place.point).squared_distance), 0.19);
  }
  // The interval is what it is without the list, or wider.
  options.list_beyond = false;
  options.limit.reset();
  const ShellDistance plain = curved_hausdorff(shell, target, options);
  EXPECT_GE(found.both.upper, plain.both.lower);
  EXPECT_LE(found.both.lower, plain.both.upper);
  options.list_beyond = true;
  options.limit = 1;
  const ShellDistance within = curved_hausdorff(shell, target, options);
  EXPECT_LE(within.both.upper, 1);
  EXPECT_TRUE(within.beyond_of_shell.empty() && within.beyond_of_target.empty());
}

class Bounds : public ::testing::TestWithParam<Patch> {};

TEST_P(Bounds, UpperIsNeverBelowDenseSamples) {
  ShellMesh shell = rough_shell(1, 0.25, 0.05);
  shell.patch = GetParam();
  const Target target(testing::sphere(3));
  const Tessellation fine = tessellate_uniformly(shell, 60);
  double from_shell = 0;
  for (const double d : vertex_distances(fine.mesh, target.tree())) {
    from_shell = std::max(from_shell, d);
  }
  const ClosestPoint tree(fine.mesh);
  double to_shell = 0;
  for (const auto& [a, b, c] : target.mesh().triangles) {
    const auto& v = target.mesh().vertices;
    for (const Vec3& p : {v[a], Vec3((v[a] + v[b]) / 2), Vec3((v[a] + v[b] + v[c]) / 3)}) {
      to_shell = std::max(to_shell, std::sqrt(tree.closest(p).squared_distance) - fine.deviation);
    }
  }
  for (const double width : {0.3, 0.03, 0.003}) {
    ShellDistanceOptions options;
    options.width = width;
    const ShellDistance found = curved_hausdorff(shell, target, options);
    EXPECT_GE(found.shell_to_target.upper, from_shell);
    EXPECT_GE(found.target_to_shell.upper, to_shell);
    options.limit = 0.9 * std::max(from_shell, to_shell);
    EXPECT_GT(curved_hausdorff(shell, target, options).both.upper, *options.limit);
    options.limit = found.both.upper + width;
    EXPECT_LE(curved_hausdorff(shell, target, options).both.upper, *options.limit);
  }
}

INSTANTIATE_TEST_SUITE_P(CurvedHausdorff, Bounds, ::testing::Values(Patch::comas, Patch::watertight));

TEST(CurvedHausdorff, IntervalsOfAMillionthOfTheDiagonal) {
  for (const auto& [shell, mesh] : {std::pair(rough_shell(2, 0.1, 0.01), testing::sphere(3)),
                                    std::pair(rough_shell(1, 0.2, 0.03), testing::sphere(4))}) {
    const Target target(mesh);
    ShellDistanceOptions options;
    options.width = 1e-3 * target.diagonal();
    const ShellDistance wide = curved_hausdorff(shell, target, options);
    options.width = 1e-6 * target.diagonal();
    const ShellDistance narrow = curved_hausdorff(shell, target, options);
    for (const auto& [one, other] : {std::pair(narrow.shell_to_target, wide.shell_to_target),
                                     {narrow.target_to_shell, wide.target_to_shell},
                                     {narrow.both, wide.both}}) {
      EXPECT_LE(one.upper - one.lower, 1.01 * options.width);
      EXPECT_LE(one.lower, other.upper);
      EXPECT_GE(one.upper, other.lower);
    }
    // The points named have the distances named.
    EXPECT_NEAR(std::sqrt(target.tree().closest(narrow.farthest_of_shell).squared_distance),
                narrow.shell_to_target.lower, options.width);
    EXPECT_NEAR((narrow.farthest_of_target - narrow.closest_to_farthest_of_target).norm(), narrow.target_to_shell.lower,
                options.width);
  }
}

TEST(CurvedHausdorff, OffsetPlanesAreMeasuredExactly) {
  // Two triangles that face upward, 0.3 above a target that reaches 0.4 farther on one side.
  ShellMesh shell;
  shell.vertices = {Vec3(0, 0, 0.3), Vec3(1, 0, 0.3), Vec3(1, 1, 0.3), Vec3(0, 1, 0.3)};
  shell.triangles = {{0, 1, 2}, {0, 2, 3}};
  shell.normals.assign(4, Vec3::UnitZ());
  TriangleMesh plane;
  plane.vertices = {Vec3(0, 0, 0), Vec3(1.4, 0, 0), Vec3(1.4, 1, 0), Vec3(0, 1, 0)};
  plane.triangles = {{0, 1, 2}, {0, 2, 3}};
  const Target target(plane);
  for (const double part : {1e-2, 1e-4, 1e-6}) {
    ShellDistanceOptions options;
    options.width = part * target.diagonal();
    const ShellDistance found = curved_hausdorff(shell, target, options);
    EXPECT_LE(found.shell_to_target.lower, 0.3);
    EXPECT_GE(found.shell_to_target.upper, 0.3);
    EXPECT_LE(found.target_to_shell.lower, 0.5);
    EXPECT_GE(found.target_to_shell.upper, 0.5);
    EXPECT_LE(found.both.upper - found.both.lower, 1.01 * options.width);
  }
}

TEST(CurvedHausdorff, IsTheSameWithAnyNumberOfThreads) {
  const ShellMesh shell = rough_shell(2, 0.2, 0.03);
  const Target target(testing::sphere(4));
  ShellDistanceOptions options;
  options.width = 1e-4 * target.diagonal();
  set_thread_count(1);
  const ShellDistance one = curved_hausdorff(shell, target, options);
  set_thread_count(2);
  const ShellDistance two = curved_hausdorff(shell, target, options);
  EXPECT_EQ(one.both.lower, two.both.lower);
  EXPECT_EQ(one.both.upper, two.both.upper);
}

}  // namespace
}  // namespace tunica
