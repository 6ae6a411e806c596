#include "tunica/volume/cubes/marching_cubes.hpp"

#include "mesh_check.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

namespace tunica {
namespace {

using test::above;
using test::below;
using test::check_mesh;
using test::label_one;
using test::make_volume;
using test::MeshCheck;
using test::Random;
using test::sphere_value;

void expect_closed_manifold(const TriangleMesh& mesh, const std::string& what) {
  const MeshCheck check = check_mesh(mesh);
  EXPECT_TRUE(check.closed()) << what;
  EXPECT_TRUE(check.manifold()) << what << ": edges " << check.bad_edges << " inconsistent " << check.inconsistent_edges
                                << " vertices " << check.bad_vertices << " unused " << check.unused_vertices;
  EXPECT_GT(check.least_sine, 1e-8) << what;
  EXPECT_EQ(check.coincident_vertices, 0U) << what;
}

TEST(MarchingCubes, EveryPairOfNeighbouringCellsInEveryDirection) {
  for (int axis = 0; axis < 3; ++axis) {
    std::array<std::size_t, 3> dims{2, 2, 2};
    dims[axis] = 3;
    for (unsigned bits = 1; bits < 4096; ++bits) {
      unsigned next = bits;
      const Volume volume = make_volume<std::uint8_t>(dims, [&](auto...) {
        const unsigned bit = next & 1;
        next >>= 1;
        return bit;
      });
      const TriangleMesh mesh = marching_cubes(volume, label_one);
      const MeshCheck check = check_mesh(mesh);
      ASSERT_TRUE(check.closed() && check.manifold() && check.coincident_vertices == 0) << bits << " axis " << axis;
      ASSERT_GT(check.least_sine, 0.1) << bits;
      ASSERT_GT(check.volume, 0) << bits;
    }
  }
}

TEST(MarchingCubes, NoiseOfEveryDensityIsAClosedManifold) {
  Random random(7);
  for (const double density : {0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98}) {
    const Volume volume = make_volume<std::int16_t>({23, 17, 70}, [&](auto...) { return random.uniform() < density; });
    expect_closed_manifold(marching_cubes(volume, label_one), "density " + std::to_string(density));
    MarchingCubesOptions open;
    open.open_border = true;
    const MeshCheck check = check_mesh(marching_cubes(volume, label_one, open));
    EXPECT_TRUE(check.manifold()) << density;
    EXPECT_EQ(check.coincident_vertices, 0U);
    EXPECT_GT(check.boundary_edges, 0U);
  }
}

TEST(MarchingCubes, RowsOfEveryLengthAroundAWord) {
  Random random(8);
  for (std::size_t columns = 1; columns <= 131; ++columns) {
    const Volume volume = make_volume<std::uint8_t>({columns, 4, 3}, [&](auto...) { return random.bits() & 1; });
    expect_closed_manifold(marching_cubes(volume, label_one), "columns " + std::to_string(columns));
    MarchingCubesOptions open;
    open.open_border = true;
    EXPECT_TRUE(check_mesh(marching_cubes(volume, label_one, open)).manifold()) << columns;
  }
}

TEST(MarchingCubes, OneVoxelIsAnOctahedron) {
  const Volume volume = make_volume<std::uint8_t>({1, 1, 1}, [](auto...) { return 1; });
  const TriangleMesh mesh = marching_cubes(volume, label_one);
  EXPECT_EQ(mesh.vertices.size(), 6U);
  EXPECT_EQ(mesh.triangles.size(), 8U);
  EXPECT_DOUBLE_EQ(check_mesh(mesh).volume, 1.0 / 6);
}

TEST(MarchingCubes, NormalsPointOutwardWhateverTheAffine) {
  Random random(3);
  const Volume base = make_volume<float>(
      {20, 22, 18}, [](auto i, auto j, auto k) { return sphere_value(i, j, k, Vec3(9.3, 10.1, 8.7), 6.4); });
  const double voxels = check_mesh(marching_cubes(base, above(0))).volume;
  for (int trial = 0; trial < 20; ++trial) {
    Volume volume = base;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        volume.affine(row, column) = 4 * random.uniform() - 2;
      }
    }
    const double determinant = volume.affine.leftCols<3>().determinant();
    const TriangleMesh mesh = marching_cubes(volume, above(0));
    expect_closed_manifold(mesh, "affine");
    EXPECT_NEAR(check_mesh(mesh).volume, voxels * std::abs(determinant), 1e-9);
  }
}

TEST(MarchingCubes, GreySphereConvergesWithTheSquareOfTheVoxel) {
  std::vector<double> errors;
  for (const std::size_t size : {16, 32, 64}) {
    const double radius = 0.4 * static_cast<double>(size);
    const Vec3 centre = Vec3(0.493, 0.507, 0.498) * static_cast<double>(size);
    const Volume volume = make_volume<double>(
        {size, size, size}, [&](auto i, auto j, auto k) { return sphere_value(i, j, k, centre, radius); });
    const MeshCheck check = check_mesh(marching_cubes(volume, above(0)));
    EXPECT_EQ(check.components, 1U);
    EXPECT_EQ(check.euler, 2);
    const double truth = 4.0 / 3 * M_PI * radius * radius * radius;
    errors.push_back(std::abs(check.volume - truth) / truth);
  }
  for (std::size_t level = 1; level < errors.size(); ++level) {
    EXPECT_NEAR(std::log2(errors[level - 1] / errors[level]), 2, 0.2);
  }
}

TEST(MarchingCubes, SamplesEqualToTheValueMakeNoDegenerateTriangle) {
  // A distance rounded to whole numbers: large plateaus at the value.
  for (const double scale : {1.0, 2.0, 10.0}) {
    for (const double value : {0.0, 1.0, 2.0}) {
      const Volume volume = make_volume<std::int16_t>({24, 24, 24}, [&](auto i, auto j, auto k) {
        return std::round(scale * sphere_value(i, j, k, Vec3(11.5, 11.5, 12), 8)) / scale;
      });
      for (const Inside& rule : {above(value), below(value)}) {
        expect_closed_manifold(marching_cubes(volume, rule), "plateau " + std::to_string(value));
      }
    }
  }
}

TEST(MarchingCubes, SmallWholeNumbersAtRandomMakeNoDegenerateTriangle) {
  Random random(11);
  for (const unsigned levels : {2U, 3U, 5U, 20U}) {
    for (int trial = 0; trial < 6; ++trial) {
      const Volume volume = make_volume<std::uint8_t>({13, 11, 12}, [&](auto...) { return random.bits() % levels; });
      for (unsigned value = 0; value < std::min(levels, 5U); ++value) {
        for (const Inside& rule : {above(value), below(value)}) {
          expect_closed_manifold(marching_cubes(volume, rule), "levels " + std::to_string(levels));
          MarchingCubesOptions open;
          open.open_border = true;
          const MeshCheck check = check_mesh(marching_cubes(volume, rule, open));
          EXPECT_TRUE(check.manifold() && check.coincident_vertices == 0);
          EXPECT_GT(check.least_sine, 1e-8);
        }
      }
    }
  }
}

TEST(MarchingCubes, ASphereThroughSamplesKeepsItsPlaceAndTopology) {
  // The exact distance equals 5 at many samples (3-4-5 triangles).
  const Volume volume =
      make_volume<double>({13, 13, 13}, [](auto i, auto j, auto k) { return sphere_value(i, j, k, Vec3(6, 6, 6), 5); });
  const TriangleMesh mesh = marching_cubes(volume, above(0));
  expect_closed_manifold(mesh, "sphere of radius 5");
  EXPECT_EQ(check_mesh(mesh).euler, 2);
  EXPECT_GT(check_mesh(mesh).least_sine, 0.01);
  for (const Vec3& p : mesh.vertices) {
    EXPECT_NEAR((p - Vec3(6, 6, 6)).norm(), 5, 0.06);
  }
}

TEST(MarchingCubes, ASampleThatIsNotFiniteIsOutsideOrHalfWay) {
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    Random random(4);
    const Volume volume = make_volume<float>({12, 12, 12}, [&](auto i, auto j, auto k) {
      return random.uniform() < 0.1 ? bad : sphere_value(i, j, k, Vec3(5.5, 5.5, 5.5), 4);
    });
    for (const Inside& rule : {above(0), below(0), Inside{Inside::Rule::label, 1}}) {
      const TriangleMesh mesh = marching_cubes(volume, rule);
      for (const Vec3& p : mesh.vertices) {
        ASSERT_TRUE(p.allFinite());
      }
      if (!mesh.triangles.empty()) {
        expect_closed_manifold(mesh, std::to_string(bad));
      }
    }
  }
  const Volume nan = make_volume<double>({4, 4, 4}, [](auto...) { return std::nan(""); });
  EXPECT_EQ(count_voxels(select(nan, above(0))), 0U);
  EXPECT_EQ(count_voxels(select(nan, below(0))), 0U);
}

TEST(MarchingCubes, HugeValuesDoNotOverflow) {
  const Volume volume = make_volume<double>({2, 1, 1}, [](auto i, auto, auto) { return i == 0 ? -1.7e308 : 1.7e308; });
  MarchingCubesOptions open;
  open.open_border = true;
  for (const Vec3& p : marching_cubes(volume, above(0), open).vertices) {
    EXPECT_DOUBLE_EQ(p[0], 0.5);
  }
}

TEST(MarchingCubes, WhatTheBorderCutsIsClosedOnTheVoxelFaces) {
  const Volume volume = make_volume<std::uint8_t>({5, 4, 3}, [](auto...) { return 1; });
  const TriangleMesh mesh = marching_cubes(volume, label_one);
  expect_closed_manifold(mesh, "full block");
  Eigen::AlignedBox3d box;
  for (const Vec3& p : mesh.vertices) {
    box.extend(p);
  }
  EXPECT_EQ(box.min(), Vec3(-0.5, -0.5, -0.5));
  EXPECT_EQ(box.max(), Vec3(4.5, 3.5, 2.5));
}

TEST(MarchingCubes, OpenBorderEndsFlatOnTheImageBorder) {
  const Volume volume = make_volume<float>(
      {30, 30, 12}, [](auto i, auto j, auto) { return sphere_value(i, j, 0, Vec3(14.2, 15.1, 0), 8.3); });
  MarchingCubesOptions open;
  open.open_border = true;
  const TriangleMesh mesh = marching_cubes(volume, above(0), open);
  const MeshCheck check = check_mesh(mesh);
  EXPECT_TRUE(check.manifold());
  EXPECT_EQ(check.components, 1U);
  EXPECT_EQ(check.euler, 0);
  double lowest = 100;
  double highest = -100;
  for (const Vec3& p : mesh.vertices) {
    lowest = std::min(lowest, p[2]);
    highest = std::max(highest, p[2]);
  }
  EXPECT_EQ(lowest, -0.5);
  EXPECT_EQ(highest, 11.5);
  // Every boundary edge lies in one of the two planes.
  std::map<std::pair<Index, Index>, int> edges;
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      ++edges[std::minmax(t[i], t[(i + 1) % 3])];
    }
  }
  for (const auto& [edge, uses] : edges) {
    if (uses == 1) {
      const double z = mesh.vertices[edge.first][2];
      EXPECT_TRUE(z == -0.5 || z == 11.5);
      EXPECT_EQ(mesh.vertices[edge.second][2], z);
    }
  }
  EXPECT_NEAR(check.area, 2 * M_PI * 8.3 * 12, 2);
}

TEST(MarchingCubes, AVolumeOneVoxelThickHasOpenEnds) {
  const Volume volume = make_volume<std::uint8_t>(
      {9, 9, 1}, [](auto i, auto j, auto) { return sphere_value(i, j, 0, Vec3(4, 4, 0), 3) > 0; });
  MarchingCubesOptions open;
  open.open_border = true;
  const MeshCheck check = check_mesh(marching_cubes(volume, label_one, open));
  EXPECT_TRUE(check.manifold());
  EXPECT_EQ(check.euler, 0);
}

TEST(MarchingCubes, SameToTheBitWhateverTheNumberOfThreads) {
  Random random(5);
  const Volume volume = make_volume<std::int8_t>({50, 40, 60}, [&](auto i, auto j, auto k) {
    return sphere_value(i, j, k, Vec3(25, 20, 30), 17) + 3 * random.uniform();
  });
  const std::size_t threads = thread_count();
  set_thread_count(1);
  const TriangleMesh one = marching_cubes(volume, above(0));
  for (const std::size_t count : {2, 3, 8}) {
    set_thread_count(count);
    const TriangleMesh many = marching_cubes(volume, above(0));
    EXPECT_EQ(one.vertices, many.vertices);
    EXPECT_EQ(one.triangles, many.triangles);
  }
  set_thread_count(threads);
}

TEST(MarchingCubes, EmptyAndFlatVolumesAreToldApart) {
  const Volume volume = make_volume<std::uint8_t>({4, 4, 4}, [](auto...) { return 0; });
  EXPECT_TRUE(marching_cubes(volume, label_one).triangles.empty());
  Volume flat = volume;
  flat.affine(2, 2) = 0;
  EXPECT_THROW(marching_cubes(flat, label_one), InputError);
  Volume none;
  none.data = std::vector<std::uint8_t>{};
  EXPECT_THROW(marching_cubes(none, label_one), InputError);
}

}  // namespace
}  // namespace tunica
