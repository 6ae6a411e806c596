#include "mesh_check.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/volume/cubes/cell_crossings.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/phantom/phantom.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <ostream>

namespace tunica {
namespace {

using test::check_mesh;
using test::label_one;
using test::make_volume;
using test::Random;

/// Largest move of a vertex along an axis of the image, in voxels.
double largest_move(const TriangleMesh& before, const TriangleMesh& after, const Mask& grid) {
  const Mat3 to_voxel = grid.affine().leftCols<3>().inverse();
  double largest = 0;
  for (std::size_t v = 0; v < before.vertices.size(); ++v) {
    largest = std::max(largest, (to_voxel * (after.vertices[v] - before.vertices[v])).cwiseAbs().maxCoeff());
  }
  return largest;
}

/// Area-weighted mean distance of a surface to another, from every fourth facet.
double mean_distance(const TriangleMesh& mesh, const ClosestPoint& truth) {
  double sum = 0;
  double weights = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 4) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 centre = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3;
    const double weight = triangle_area(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]);
    sum += weight * std::sqrt(truth.closest(centre).squared_distance);
    weights += weight;
  }
  return sum / weights;
}

PhantomOptions phantom(PhantomShape shape, std::size_t size, const Vec3& spacing = Vec3::Ones()) {
  PhantomOptions options;
  options.shape = shape;
  options.size = size;
  options.spacing = spacing;
  return options;
}

struct Smoothed {
  std::string shape;
  std::size_t size;
  Vec3 spacing;
  double gain;  ///< error of the smoothed surface over that of the staircase, at most
};

void PrintTo(const Smoothed& phantom, std::ostream* out) { *out << phantom.shape; }

class StaircaseOf : public testing::TestWithParam<Smoothed> {};

INSTANTIATE_TEST_SUITE_P(
    Phantoms, StaircaseOf,
    testing::Values(Smoothed{"sphere", 48, Vec3(1, 1, 1), 0.2}, Smoothed{"aneurysm", 96, Vec3(1, 1, 1), 0.3},
                    Smoothed{"tube", 64, Vec3(0.7, 0.7, 2), 0.3}, Smoothed{"capsule", 64, Vec3(1, 1, 1), 0.25},
                    Smoothed{"bladder", 64, Vec3(0.8, 0.8, 3), 0.4}, Smoothed{"colon", 80, Vec3(1, 1, 1), 0.5},
                    Smoothed{"sphere", 32, Vec3(1, 1, 1), 0.2}, Smoothed{"sphere", 96, Vec3(0.78, 0.78, 5), 0.3},
                    Smoothed{"tube", 32, Vec3(1, 1, 1), 0.35}, Smoothed{"tube", 128, Vec3(1, 1, 1), 0.2},
                    Smoothed{"tube", 128, Vec3(1, 1, 5), 0.3}, Smoothed{"aneurysm", 48, Vec3(1, 1, 1), 0.5},
                    Smoothed{"aneurysm", 64, Vec3(1, 1, 2), 0.3}, Smoothed{"aneurysm", 64, Vec3(1, 1, 1), 0.5},
                    Smoothed{"aneurysm", 128, Vec3(1, 1, 1), 0.22}, Smoothed{"aneurysm", 128, Vec3(1, 1, 5), 0.35},
                    Smoothed{"capsule", 128, Vec3(1, 1, 1), 0.22}, Smoothed{"capsule", 96, Vec3(0.78, 0.78, 5), 0.35},
                    Smoothed{"bladder", 128, Vec3(1, 1, 1), 0.22}, Smoothed{"bladder", 128, Vec3(1, 1, 5), 0.35},
                    Smoothed{"bladder", 48, Vec3(0.8, 0.8, 3), 0.5}, Smoothed{"tube", 48, Vec3(0.78, 0.78, 5), 0.5},
                    Smoothed{"colon", 128, Vec3(1, 1, 1), 0.37}, Smoothed{"colon", 64, Vec3(1, 1, 1), 0.5},
                    Smoothed{"colon", 48, Vec3(1, 1, 1), 0.6}, Smoothed{"colon", 96, Vec3(0.8, 0.8, 3), 0.55},
                    Smoothed{"colon", 128, Vec3(0.8, 0.8, 3), 0.5}));

TEST_P(StaircaseOf, StaysWithinHalfAVoxelKeepsTheVolumeAndComesCloserToTheTruth) {
  const PhantomOptions options = phantom(*phantom_shape(GetParam().shape), GetParam().size, GetParam().spacing);
  const Mask mask = select(make_phantom(options).volume, label_one);
  MarchingCubesOptions extraction;
  extraction.open_border = GetParam().shape == "tube" || GetParam().shape == "aneurysm";
  const TriangleMesh before = marching_cubes(mask, extraction);
  TriangleMesh after = before;
  StaircaseOptions smoothing;
  smoothing.open_border = extraction.open_border;
  const StaircaseResult result = smooth_staircase(after, mask, smoothing);

  EXPECT_EQ(before.triangles, after.triangles);
  EXPECT_LE(largest_move(before, after, mask), 0.5);
  EXPECT_NEAR(largest_move(before, after, mask), result.largest_move, 1e-9);
  EXPECT_NEAR(phantom_volume(after) / phantom_volume(before), 1, 1e-3);
  EXPECT_LE(result.volume_change, 1e-3);
  const auto check = check_mesh(after);
  EXPECT_TRUE(check.manifold());
  EXPECT_GT(check.least_sine, 1e-3);
  const TriangleMesh truth = phantom_surface(options);
  const ClosestPoint tree(truth);
  EXPECT_LT(mean_distance(after, tree), GetParam().gain * mean_distance(before, tree));
  EXPECT_NEAR(area(after), area(truth), 0.03 * area(truth));
}

TEST(Staircase, TheErrorOfAVesselOf256VoxelsIsMoreThanHalved) {
  const PhantomOptions options = phantom(PhantomShape::aneurysm, 256);
  const Mask mask = select(make_phantom(options).volume, label_one);
  MarchingCubesOptions open;
  open.open_border = true;
  TriangleMesh mesh = marching_cubes(mask, open);
  const TriangleMesh truth = phantom_surface(options);
  const ClosestPoint tree(truth);
  EXPECT_GT(mean_distance(mesh, tree), 0.00040 * diagonal(truth));
  StaircaseOptions smoothing;
  smoothing.open_border = true;
  smooth_staircase(mesh, mask, smoothing);
  EXPECT_LT(mean_distance(mesh, tree), 0.00008 * diagonal(truth));
}

TEST(Staircase, ABallInThickSlicesHasNoPlateaus) {
  // 12 slices of 5 mm: the last one is a plateau 11 voxels wide, 2 mm above the pole.
  const PhantomOptions options = phantom(PhantomShape::sphere, 60, Vec3(1, 1, 5));
  const Mask mask = select(make_phantom(options).volume, label_one);
  TriangleMesh mesh = marching_cubes(mask, {});
  smooth_staircase(mesh, mask);
  const TriangleMesh truth = phantom_surface(options);
  const ClosestPoint tree(truth);
  double farthest = 0;
  for (const Vec3& p : mesh.vertices) {
    farthest = std::max(farthest, std::sqrt(tree.closest(p).squared_distance));
  }
  EXPECT_LT(farthest, 0.7);
}

TEST(Staircase, ThickSlicesMoveAlongTheirOwnAxisOnly) {
  // Slices of 5 mm: up to 2.5 mm across the slices, and no more than 0.4 mm within.
  const Mask mask = select(make_phantom(phantom(PhantomShape::bladder, 96, Vec3(0.8, 0.8, 5))).volume, label_one);
  const TriangleMesh before = marching_cubes(mask);
  TriangleMesh after = before;
  smooth_staircase(after, mask);
  Vec3 largest = Vec3::Zero();
  for (std::size_t v = 0; v < before.vertices.size(); ++v) {
    largest = largest.cwiseMax((after.vertices[v] - before.vertices[v]).cwiseAbs());
  }
  EXPECT_LE(largest[0], 0.4);
  EXPECT_LE(largest[1], 0.4);
  EXPECT_LE(largest[2], 2.5);
  EXPECT_GT(largest[2], 1);
}

TEST(Staircase, AnInclinedPlaneBecomesFlat) {
  // 1 in 12: steps twelve voxels long.
  const Volume volume = make_volume<std::uint8_t>({60, 20, 16}, [](auto i, auto, auto k) { return 12 * k < i + 60; });
  const Mask mask = select(volume, label_one);
  MarchingCubesOptions open;
  open.open_border = true;
  TriangleMesh mesh = marching_cubes(mask, open);
  StaircaseOptions smoothing;
  smoothing.open_border = true;
  smooth_staircase(mesh, mask, smoothing);
  // The steps' mean height: (i + 60) / 12 rounded up, less 1, and half a voxel.
  double worst = 0;
  for (const Vec3& p : mesh.vertices) {
    if (p[0] > 12 && p[0] < 47) {
      worst = std::max(worst, std::abs(p[2] - (p[0] + 60) / 12 - 11.0 / 24 + 0.5));
    }
  }
  EXPECT_LT(worst, 0.25);
}

TEST(Staircase, OpenEndsStayInThePlaneOfTheBorder) {
  PhantomOptions options;
  options.shape = PhantomShape::tube;
  options.size = 48;
  const Mask mask = select(make_phantom(options).volume, label_one);
  MarchingCubesOptions open;
  open.open_border = true;
  const TriangleMesh before = marching_cubes(mask, open);
  TriangleMesh after = before;
  StaircaseOptions smoothing;
  smoothing.open_border = true;
  smooth_staircase(after, mask, smoothing);
  std::size_t ends = 0;
  for (std::size_t v = 0; v < before.vertices.size(); ++v) {
    if (std::abs(std::abs(before.vertices[v][2]) - 24) < 1e-9) {
      EXPECT_NEAR(after.vertices[v][2], before.vertices[v][2], 1e-9);
      ++ends;
    } else {
      EXPECT_LT(std::abs(after.vertices[v][2]), 24);
    }
  }
  EXPECT_GT(ends, 20U);
}

TEST(Staircase, EachPieceKeepsItsVolumeAndThinOnesDoNotVanish) {
  // A ball, a rod two voxels thick, a plate one voxel thick, and a single voxel.
  const Volume volume = make_volume<std::uint8_t>({40, 60, 24}, [](auto i, auto j, auto k) {
    const bool ball = test::sphere_value(i, j, k, Vec3(12, 14, 11), 8) > 0;
    const bool rod = i >= 30 && i < 32 && k >= 10 && k < 12 && j >= 4 && j < 50;
    const bool plate = k == 11 && i >= 4 && i < 24 && j >= 36 && j < 54;
    return ball || rod || plate || (i == 36 && j == 30 && k == 5);
  });
  const Mask mask = select(volume, label_one);
  const TriangleMesh before = marching_cubes(mask);
  TriangleMesh after = before;
  const StaircaseResult result = smooth_staircase(after, mask);
  EXPECT_LE(result.volume_change, 1e-3);
  EXPECT_LE(largest_move(before, after, mask), 0.5);
  const auto check = check_mesh(after);
  EXPECT_TRUE(check.closed() && check.manifold());
  EXPECT_EQ(check.components, 4U);
  EXPECT_GT(check.least_sine, 1e-3);
  // The rod is as thick in the middle as it was: about 1.6 voxels across.
  double widest = 0;
  for (const Vec3& p : after.vertices) {
    if (p[0] > 28 && p[0] < 34 && std::abs(p[1] - 27) < 3) {
      widest = std::max(widest, std::abs(p[0] - 30.5));
    }
  }
  EXPECT_GT(widest, 0.6);
}

TEST(Staircase, NoiseStaysAManifoldWithoutTurnedTriangles) {
  Random random(31);
  for (const double density : {0.2, 0.5, 0.8}) {
    Volume volume = make_volume<std::uint8_t>({24, 20, 18}, [&](auto...) { return random.uniform() < density; });
    volume.affine.leftCols<3>() << -0.5, 0.1, 0, 0.2, 0.6, 0.1, 0, 0.3, 2;
    const Mask mask = select(volume, label_one);
    const TriangleMesh before = marching_cubes(mask);
    TriangleMesh after = before;
    smooth_staircase(after, mask);
    EXPECT_LE(largest_move(before, after, mask), 0.5);
    const auto check = check_mesh(after);
    EXPECT_TRUE(check.closed() && check.manifold());
    EXPECT_GT(check.least_sine, 1e-4);
    for (std::size_t t = 0; t < before.triangles.size(); ++t) {
      const auto& [a, b, c] = before.triangles[t];
      const auto normal = [&](const TriangleMesh& mesh) -> Vec3 {
        return (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
      };
      ASSERT_GT(normal(before).dot(normal(after)), 0);
    }
  }
}

/// Pairs of triangles without a common edge that meet elsewhere than in a common corner: all against all.
std::vector<std::array<Index, 2>> crossings(const TriangleMesh& mesh) {
  auto found = find_self_intersections(mesh);
  std::vector<std::vector<Index>> around(mesh.vertices.size());
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    for (const Index v : mesh.triangles[t]) {
      around[v].push_back(t);
    }
  }
  for (Index v = 0; v < around.size(); ++v) {
    const auto from_v = [&](Index t) {
      auto c = mesh.triangles[t];
      std::rotate(c.begin(), std::find(c.begin(), c.end(), v), c.end());
      return c;
    };
    for (const Index one : around[v]) {
      for (const Index other : around[v]) {
        const auto c = from_v(one), d = from_v(other);
        const bool share_edge = c[1] == d[1] || c[1] == d[2] || c[2] == d[1] || c[2] == d[2];
        if (one < other && !share_edge &&
            triangles_cross_beside_corner({mesh.vertices[v], mesh.vertices[c[1]], mesh.vertices[c[2]]},
                                          {mesh.vertices[v], mesh.vertices[d[1]], mesh.vertices[d[2]]})) {
          found.push_back({one, other});
        }
      }
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

TEST(Staircase, NoTrianglesCross) {
  // Noise, and folds one voxel thick that are one voxel apart and inclined to the grid.
  Random random(5);
  for (const double density : {0.15, 0.85}) {
    const Mask mask =
        select(make_volume<std::uint8_t>({24, 20, 18}, [&](auto...) { return random.uniform() < density; }), label_one);
    TriangleMesh mesh = marching_cubes(mask);
    ASSERT_TRUE(crossings(mesh).empty());
    smooth_staircase(mesh, mask);
    EXPECT_TRUE(crossings(mesh).empty());
  }
  const Volume folds = make_volume<std::uint8_t>({40, 40, 30}, [](auto i, auto j, auto k) {
    return i > 1 && j > 1 && k > 1 && i < 37 && j < 37 && k < 27 && (5 * i + 2 * j + 4 * k) / 6 % 3 == 0;
  });
  const Mask mask = select(folds, label_one);
  TriangleMesh mesh = marching_cubes(mask);
  ASSERT_TRUE(crossings(mesh).empty());
  smooth_staircase(mesh, mask);
  EXPECT_TRUE(crossings(mesh).empty());
}

TEST(Staircase, CrossingsAreFoundFromCellToCell) {
  // Vertices thrown by nearly half a voxel: many triangles meet, all of them near their cells.
  Random random(8);
  const Mask mask =
      select(make_volume<std::uint8_t>({14, 12, 10}, [&](auto...) { return random.uniform() < 0.4; }), label_one);
  TriangleMesh mesh = marching_cubes(mask);
  const CellCrossings cells(mesh.triangles, mesh.vertices);
  EXPECT_TRUE(cells.find(mesh.vertices).empty());
  for (Vec3& p : mesh.vertices) {
    p += 0.98 * Vec3(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
  }
  const auto found = cells.find(mesh.vertices);
  EXPECT_GT(found.size(), 100U);
  EXPECT_EQ(found, crossings(mesh));
}

TEST(Staircase, SameToTheBitWhateverTheNumberOfThreads) {
  PhantomOptions options;
  options.shape = PhantomShape::bladder;
  options.size = 40;
  const Mask mask = select(make_phantom(options).volume, label_one);
  const TriangleMesh start = marching_cubes(mask);
  const std::size_t threads = thread_count();
  set_thread_count(1);
  TriangleMesh one = start;
  smooth_staircase(one, mask);
  set_thread_count(3);
  TriangleMesh three = start;
  smooth_staircase(three, mask);
  set_thread_count(threads);
  EXPECT_EQ(one.vertices, three.vertices);
}

TEST(Staircase, NothingIsLeftAsItIs) {
  const Mask mask({4, 4, 4}, Eigen::Matrix<double, 3, 4>::Identity());
  TriangleMesh mesh;
  EXPECT_EQ(smooth_staircase(mesh, mask).largest_move, 0);
}

}  // namespace
}  // namespace tunica
