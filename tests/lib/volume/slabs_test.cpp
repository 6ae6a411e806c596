#include "mesh_check.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/cubes/label_index.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/whole_labels.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

namespace tunica {
namespace {

using test::above;
using test::below;
using test::make_volume;
using test::Random;
using test::sphere_value;

/// Slices [first, last) of a volume.
Volume slab_of(const Volume& volume, std::size_t first, std::size_t last) {
  Volume slab = volume;
  slab.dims[2] = last - first;
  const std::size_t slice = volume.dims[0] * volume.dims[1];
  std::visit(
      [&](auto& values) {
        values = std::decay_t<decltype(values)>(values.begin() + static_cast<std::ptrdiff_t>(first * slice),
                                                values.begin() + static_cast<std::ptrdiff_t>(last * slice));
      },
      slab.data);
  return slab;
}

template <typename Visit>
void for_each_slab(const Volume& volume, std::size_t slices, const Visit& visit) {
  for (std::size_t first = 0; first < volume.dims[2]; first += slices) {
    visit(slab_of(volume, first, std::min(first + slices, volume.dims[2])), first);
  }
}

void expect_same(const TriangleMesh& a, const TriangleMesh& b, const std::string& what) {
  EXPECT_EQ(a.vertices, b.vertices) << what;
  EXPECT_EQ(a.triangles, b.triangles) << what;
}

/// Cells of random points, so that labels meet in faces, edges and corners; values by `value_of(cell)`, 0 among them.
template <typename T, typename ValueOf>
Volume cells_of_points(const std::array<std::size_t, 3>& dims, std::size_t count, const ValueOf& value_of) {
  Random random(99);
  std::vector<Vec3> points;
  for (std::size_t n = 0; n < count; ++n) {
    points.emplace_back(random.uniform() * static_cast<double>(dims[0]),
                        random.uniform() * static_cast<double>(dims[1]),
                        random.uniform() * static_cast<double>(dims[2]));
  }
  return make_volume<T>(dims, [&](auto i, auto j, auto k) {
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < points.size(); ++n) {
      const double distance = (points[n] - Vec3(i, j, k)).squaredNorm();
      if (distance < least) {
        least = distance;
        nearest = n;
      }
    }
    return value_of(nearest);
  });
}

TEST(Slabs, GreyValuesGiveTheSameMeshToTheBit) {
  Random random(17);
  const Volume smooth = make_volume<float>({70, 20, 23}, [&](auto i, auto j, auto k) {
    return sphere_value(i, j, k, Vec3(33.2, 9.4, 11.7), 9.1) + 2 * random.uniform();
  });
  // Many samples equal to the value: vertices meet at samples that two slabs share.
  const Volume plateau = make_volume<std::int16_t>(
      {26, 21, 19}, [](auto i, auto j, auto k) { return std::round(sphere_value(i, j, k, Vec3(12, 10, 9), 7)); });
  for (const Volume& volume : {smooth, plateau}) {
    for (const Inside& rule : {above(0), below(1)}) {
      for (const bool open : {false, true}) {
        MarchingCubesOptions options;
        options.open_border = open;
        const TriangleMesh whole = marching_cubes(volume, rule, options);
        ASSERT_FALSE(whole.triangles.empty());
        for (const std::size_t slices : {1, 2, 5, 18}) {
          Mask mask(volume.dims, volume.affine);
          for_each_slab(volume, slices,
                        [&](const Volume& slab, std::size_t first) { select(slab, first, rule, mask); });
          EXPECT_EQ(mask, select(volume, rule));
          SlabMarchingCubes cubes(mask, rule, options);
          for_each_slab(volume, slices, [&](const Volume& slab, std::size_t first) { cubes.add(slab, first); });
          expect_same(whole, cubes.finish(), std::to_string(slices) + " slices at a time");
        }
      }
    }
  }
}

TEST(Slabs, AVolumeOneVoxelThickIsOneSlab) {
  const Volume volume =
      make_volume<float>({9, 9, 1}, [](auto i, auto j, auto k) { return sphere_value(i, j, k, Vec3(4, 4, 0), 3.3); });
  const Mask mask = select(volume, above(0));
  SlabMarchingCubes cubes(mask, above(0));
  cubes.add(volume, 0);
  expect_same(marching_cubes(volume, above(0)), cubes.finish(), "one slice");
}

TEST(LabelIndex, ThreeHundredLabelsInOnePassAreThoseOfEachLabelAlone) {
  const Volume atlas = cells_of_points<std::uint16_t>({130, 60, 50}, 340, [](std::size_t cell) {
    return cell < 40 ? 0U : static_cast<unsigned>(1 + 7 * (cell % 300));
  });
  for (const std::size_t slices : {1, 7, 50}) {
    LabelIndex index(atlas.dims, atlas.affine);
    for_each_slab(atlas, slices, [&](const Volume& slab, std::size_t first) { index.add(slab, first); });
    const auto labels = index.labels();
    ASSERT_TRUE(labels);
    EXPECT_EQ(labels->size(), 300U);
    std::size_t voxels = 0;
    for (const Label& label : *labels) {
      const Inside rule{Inside::Rule::label, label.value};
      const Mask mask = index.mask(label.value);
      ASSERT_EQ(mask, select(atlas, rule)) << label.value;
      ASSERT_EQ(count_voxels(mask), label.voxels);
      voxels += label.voxels;
      MarchingCubesOptions bounded;
      bounded.bounds = index.bounds(label.value);
      for (const bool open : {false, true}) {
        bounded.open_border = open;
        MarchingCubesOptions whole;
        whole.open_border = open;
        const TriangleMesh a = marching_cubes(mask, bounded);
        const TriangleMesh b = marching_cubes(atlas, rule, whole);
        ASSERT_EQ(a.vertices, b.vertices) << label.value;
        ASSERT_EQ(a.triangles, b.triangles) << label.value;
      }
    }
    const auto& values = std::get<std::vector<std::uint16_t>>(atlas.data);
    EXPECT_EQ(voxels, values.size() - static_cast<std::size_t>(std::ranges::count(values, 0)));
  }
}

// Edges of the grid, one voxel wider on each side, between inside and outside.
std::size_t edges_between(const Mask& mask) {
  const auto& dims = mask.dims();
  std::size_t edges = 0;
  for (std::size_t k = 0; k < dims[2]; ++k) {
    for (std::size_t j = 0; j < dims[1]; ++j) {
      for (std::size_t i = 0; i < dims[0]; ++i) {
        if (mask(i, j, k)) {
          edges += (i == 0 || !mask(i - 1, j, k)) + (i + 1 == dims[0] || !mask(i + 1, j, k));
          edges += (j == 0 || !mask(i, j - 1, k)) + (j + 1 == dims[1] || !mask(i, j + 1, k));
          edges += (k == 0 || !mask(i, j, k - 1)) + (k + 1 == dims[2] || !mask(i, j, k + 1));
        }
      }
    }
  }
  return edges;
}

TEST(LabelIndex, RowsOfEveryLengthAroundAWordAndEveryKindOfValue) {
  Random random(12);
  for (std::size_t columns = 1; columns <= 131; columns += columns < 60 ? 13 : 1) {
    const Volume volume = make_volume<double>({columns, 3, 2}, [&](auto...) {
      const unsigned kind = random.bits() % 6;
      return kind == 5 ? std::nan("") : kind == 4 ? HUGE_VAL : kind == 3 ? -2.5 : static_cast<double>(kind);
    });
    LabelIndex index(volume.dims, volume.affine);
    index.add(volume, 0);
    const auto labels = index.labels();
    for (const Label& label : *labels) {
      EXPECT_NE(label.value, 0);
      const Mask mask = index.mask(label.value);
      EXPECT_EQ(mask, select(volume, {Inside::Rule::label, label.value})) << columns;
      EXPECT_EQ(index.surface_vertices(label.value), edges_between(mask)) << columns;
    }
  }
}

TEST(LabelIndex, LabelsHaveTheirVolumesAndNames) {
  Volume volume =
      make_volume<std::int16_t>({4, 4, 4}, [](auto i, auto, auto) { return i == 3 ? -2 : (i == 1 ? 7 : 0); });
  volume.affine(0, 0) = -2;
  LabelIndex index(volume.dims, volume.affine);
  index.add(volume, 0);
  const auto labels = index.labels({{7, "bladder"}});
  ASSERT_TRUE(labels);
  ASSERT_EQ(labels->size(), 2U);
  EXPECT_EQ((*labels)[0].value, -2);
  EXPECT_EQ((*labels)[1].voxels, 16U);
  EXPECT_EQ((*labels)[1].volume_mm3, 32);
  EXPECT_EQ((*labels)[1].name, "bladder");
  volume.slope = 0.5;
  volume.intercept = 1;
  LabelIndex scaled(volume.dims, volume.affine);
  scaled.add(volume, 0);
  const auto meant = scaled.labels();
  ASSERT_EQ(meant->size(), 2U);  // -2 now means 0, 0 means 1
  EXPECT_EQ((*meant)[0].value, 1);
  EXPECT_EQ((*meant)[0].voxels, 32U);
  EXPECT_EQ((*meant)[1].value, 4.5);
}

TEST(LabelIndex, ValuesNextToWholeNumbersAreThoseLabels) {
  const auto labels_of = [](const Volume& volume) {
    LabelIndex index(volume.dims, volume.affine);
    for_each_slab(volume, 2, [&](const Volume& slab, std::size_t first) { index.add(slab, first); });
    const auto labels = index.labels();
    for (const Label& label : *labels) {
      const Mask mask = index.mask(label.value);
      EXPECT_EQ(mask, select(volume, {Inside::Rule::label, label.value})) << label.value;
      EXPECT_EQ(label.voxels, count_voxels(mask));
      EXPECT_EQ(index.surface_vertices(label.value), edges_between(mask));
    }
    std::vector<double> values;
    for (const Label& label : *labels) {
      values.push_back(label.value);
    }
    return values;
  };
  Random random(5);
  // The noise of a resampling, and zeros that are not quite.
  const auto noisy = [&](double size) {
    return make_volume<double>({70, 5, 6}, [&](auto i, auto, auto k) {
      return static_cast<double>(i / 20 % 3) + (k % 2 == 0 ? size * (random.uniform() - 0.5) : 0);
    });
  };
  EXPECT_EQ(labels_of(noisy(1.9e-3)), (std::vector<double>{1, 2}));
  EXPECT_GT(labels_of(noisy(3e-3)).size(), 3U);
  // A mask of 0 and 255 by the slope 1/255 of a header of 32-bit floats.
  Volume mask = make_volume<std::uint8_t>({70, 4, 4}, [](auto i, auto...) { return i % 3 == 0 ? 255 : 0; });
  mask.slope = static_cast<double>(1.0F / 255.0F);
  EXPECT_NE(mask.slope * 255, 1);
  EXPECT_EQ(labels_of(mask), (std::vector<double>{1}));
  const Volume scaled = make_volume<float>({70, 4, 4}, [](auto i, auto...) { return i % 3 == 0 ? 2.9999F : 5.5F; });
  EXPECT_EQ(labels_of(scaled), (std::vector<double>{3, 5.5}));
}

TEST(LabelIndex, LabelsThatDoublesCannotTellApartAreRefused) {
  const auto index_of = [](std::uint64_t label) {
    const Volume volume = make_volume<std::uint64_t>({3, 3, 3}, [&](auto i, auto...) { return i == 1 ? label : 0; });
    LabelIndex index(volume.dims, volume.affine);
    index.add(volume, 0);
    return index.labels()->at(0).value;
  };
  EXPECT_EQ(index_of(std::uint64_t{1} << 60), 0x1p60);
  EXPECT_THROW(index_of((std::uint64_t{1} << 53) + 1), InputError);
  EXPECT_THROW(index_of(std::numeric_limits<std::uint64_t>::max()), InputError);
}

TEST(LabelIndex, ALabelOfSeveralNamesHasThemAll) {
  const Volume volume = make_volume<std::uint8_t>({3, 3, 3}, [](auto i, auto...) { return i == 1 ? 7 : 0; });
  LabelIndex index(volume.dims, volume.affine);
  index.add(volume, 0);
  EXPECT_EQ(index.labels({{7, "vein"}, {7, "aorta"}, {7, "vein"}})->at(0).name, "aorta / vein");
}

TEST(Wholeness, CountsWhatIsRoundedAndWhatLiesBetween) {
  const Volume volume = make_volume<float>({8, 1, 3}, [](auto i, auto, auto k) {
    constexpr std::array<float, 8> values{0, 1, 2.0005F, 0.0001F, 2.5F, 0.37F, HUGE_VALF, -1};
    return k == 2 ? std::nanf("") : values.at(i);
  });
  Wholeness whole;
  for_each_slab(volume, 1, [&](const Volume& slab, std::size_t) { whole.add(slab); });
  EXPECT_EQ(whole.rounded, 4U);
  EXPECT_NEAR(whole.farthest, 5e-4, 1e-6);
  EXPECT_EQ(whole.between, 4U);
  EXPECT_EQ(whole.example, 2.5);
  EXPECT_EQ(whole.not_zero, 10U);  // 1, 2.0005, 2.5, 0.37 and -1, twice
  Wholeness integers;
  integers.add(make_volume<std::uint8_t>({2, 2, 2}, [](auto...) { return 3; }));
  EXPECT_EQ(integers.between + integers.rounded, 0U);
}

TEST(Volumes, ThatAreNoneAreRefused) {
  const Volume good = make_volume<std::uint8_t>({4, 4, 4}, [](auto...) { return 1; });
  const auto refused = [](const Volume& volume) {
    EXPECT_THROW(select(volume, {Inside::Rule::label, 1}), InputError);
    EXPECT_THROW(marching_cubes(volume, {Inside::Rule::above, 0.5}), InputError);
    EXPECT_THROW(smooth_values(volume, 1), InputError);
    EXPECT_THROW(Wholeness().add(volume), InputError);
    EXPECT_THROW(LabelIndex({4, 4, 4}, Volume().affine).add(volume, 0), InputError);
  };
  constexpr std::size_t huge = std::size_t{1} << 62;
  for (const auto& dims :
       {std::array<std::size_t, 3>{4, 4, 0}, {4, 4, 5}, {huge, 4, 1}, {huge, 1, 4}, {huge, huge, huge}}) {
    Volume bad = good;
    bad.dims = dims;
    refused(bad);
    if (dims[2] != 5) {
      EXPECT_THROW(Mask(dims, good.affine), InputError);
      EXPECT_THROW(LabelIndex(dims, good.affine), InputError);
    }
  }
  for (const double value : {0.0, std::nan(""), HUGE_VAL}) {
    Volume bad = good;
    bad.slope = value;
    refused(bad);
    bad = good;
    bad.affine.col(1).setConstant(value);
    refused(bad);
  }
  EXPECT_THROW(select(good, {Inside::Rule::label, std::nan("")}), InputError);
  EXPECT_THROW(marching_cubes(good, {Inside::Rule::above, std::nan("")}), InputError);
  EXPECT_THROW(marching_cubes(good, {Inside::Rule::above, 0}, Mask({4, 4, 3}, good.affine)), InputError);
  Mask mask({4, 4, 4}, good.affine);
  EXPECT_THROW(select(good, 1, {Inside::Rule::label, 1}, mask), InputError);
  EXPECT_THROW(SlabMarchingCubes(mask, {Inside::Rule::above, 0}).finish(), InputError);
  EXPECT_THROW(SlabMarchingCubes(mask, {Inside::Rule::label, 1}), InputError);
}

TEST(LabelIndex, AnImageIsNotASegmentation) {
  Random random(24);
  const Volume image = make_volume<float>({20, 20, 20}, [&](auto...) { return random.uniform(); });
  for (const std::size_t limit : {1000, 8000}) {
    LabelIndex index(image.dims, image.affine, limit);
    for_each_slab(image, 3, [&](const Volume& slab, std::size_t first) { index.add(slab, first); });
    EXPECT_EQ(index.labels().has_value(), limit == 8000);
  }
  const Volume nan = make_volume<double>({4, 4, 4}, [](auto...) { return std::nan(""); });
  LabelIndex none(nan.dims, nan.affine);
  none.add(nan, 0);
  EXPECT_TRUE(none.labels()->empty());
}

}  // namespace
}  // namespace tunica
