// The public functions of lib/volume check what they are given.
#include "damaged.hpp"
#include "tunica/volume/cubes/label_index.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/cubes/openings.hpp"
#include "tunica/volume/cubes/outward.hpp"
#include "tunica/volume/labels/hollows.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"

namespace tunica {
namespace {

using namespace arguments;

const Eigen::Matrix<double, 3, 4> unit = Eigen::Matrix<double, 3, 4>::Identity();

/// A block of voxels in the middle.
Mask block() {
  Mask mask({8, 8, 8}, unit);
  for (std::size_t k = 2; k < 6; ++k) {
    for (std::size_t j = 2; j < 6; ++j) {
      for (std::size_t i = 2; i < 6; ++i) {
        mask.set(i, j, k, true);
      }
    }
  }
  return mask;
}

Volume no_volume(std::array<std::size_t, 3> dims) {
  Volume volume;
  volume.dims = dims;
  volume.data = std::vector<std::uint8_t>(8);
  return volume;
}

TEST(VolumeArguments, MeshesAreChecked) {
  const Mask mask = block();
  expect_checked<TriangleMesh>(marching_cubes(mask),
                               {
                                   {"smooth_staircase", [&](TriangleMesh m) { smooth_staircase(m, mask); }},
                                   {"faces_outward", [&](const TriangleMesh& m) { faces_outward(m, mask, false); }},
                                   {"find_openings", [&](const TriangleMesh& m) { find_openings(mask, m); }},
                                   {"without_border", [&](const TriangleMesh& m) { without_border(m, mask); }},
                               });
}

TEST(VolumeArguments, VerticesOfNoTriangleMayBeAnywhere) {
  TriangleMesh mesh = marching_cubes(block());
  mesh.vertices.emplace_back(nan, 0, infinity);
  EXPECT_TRUE(faces_outward(mesh, block(), false));
}

TEST(VolumeArguments, DimensionsAreChecked) {
  const Mask mask = block();
  const Mask other({8, 8, 9}, unit);
  expect_refused("count_differing", [&] { count_differing(mask, other); });
  expect_refused("outer_solid", [&] { outer_solid(other, find_hollows(mask)); });
  const std::size_t huge = std::size_t{1} << 40;
  for (const auto& dims : {std::array<std::size_t, 3>{0, 2, 2}, {2, 2, 3}, {huge, huge, huge}}) {
    expect_refused("marching_cubes", [&] { marching_cubes(no_volume(dims), Inside{}); });
    expect_refused("select", [&] { select(no_volume(dims), Inside{}); });
    expect_refused("smooth_values", [&] { smooth_values(no_volume(dims), 1); });
  }
  expect_refused("Mask", [&] { Mask({huge, huge, huge}, unit); });
  expect_refused("LabelIndex", [&] { LabelIndex({huge, huge, huge}, unit); });
  expect_refused("LabelIndex of no place", [&] { LabelIndex({8, 8, 8}, unit * nan); });
}

TEST(VolumeArguments, OptionsAreChecked) {
  const Mask mask = block();
  MarchingCubesOptions options;
  for (const MaskBounds& bounds :
       {MaskBounds{{3, 2}, {0, 8}}, MaskBounds{{0, 9}, {0, 8}}, MaskBounds{{0, 8}, {7, 9}}}) {
    options.bounds = bounds;
    expect_refused("bounds", [&] { marching_cubes(mask, options); });
  }
  BorderLids lids;
  lids.closed[1][0].assign(5, true);
  options = {};
  options.open_border = true;
  options.lids = &lids;
  expect_refused("lids", [&] { marching_cubes(mask, options); });
  expect_refused("isovalue", [] {
    Volume volume = no_volume({2, 2, 2});
    marching_cubes(volume, {Inside::Rule::above, nan});
  });
}

TEST(VolumeArguments, LabelsAreChecked) {
  LabelIndex index({2, 2, 2}, unit);
  index.add(no_volume({2, 2, 2}), 0);
  expect_refused("mask", [&] { (void)index.mask(7); });
  expect_refused("bounds", [&] { (void)index.bounds(nan); });
  expect_refused("surface_vertices", [&] { (void)index.surface_vertices(1); });
}

}  // namespace
}  // namespace tunica
