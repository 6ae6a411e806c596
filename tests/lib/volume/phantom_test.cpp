#include "tunica/volume/phantom/phantom.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/components.hpp"
#include "volumes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <ostream>

namespace tunica {
namespace {

using test::label_one;

struct Shape {
  std::string name;
  bool open;
};

void PrintTo(const Shape& shape, std::ostream* out) { *out << shape.name; }

class PhantomOf : public testing::TestWithParam<Shape> {
protected:
  static PhantomOptions options(std::size_t size) {
    PhantomOptions result;
    result.shape = *phantom_shape(GetParam().name);
    result.size = size;
    return result;
  }
};

INSTANTIATE_TEST_SUITE_P(Shapes, PhantomOf,
                         testing::Values(Shape{"sphere", false}, Shape{"tube", true}, Shape{"aneurysm", true},
                                         Shape{"capsule", false}, Shape{"bladder", false}, Shape{"colon", false}),
                         [](const auto& shape) { return shape.param.name; });

TEST_P(PhantomOf, TheTruthIsAnOrientedManifoldThatEndsOnTheImageBorder) {
  PhantomOptions tall = options(48);
  tall.spacing = Vec3(0.7, 0.9, 2.5);
  const Phantom phantom = make_phantom(tall);
  const TriangleMesh truth = phantom_surface(tall);
  const MeshFacts facts = examine(truth);
  EXPECT_TRUE(facts.manifold && facts.oriented);
  EXPECT_EQ(facts.components, 1U);
  EXPECT_EQ(facts.euler, GetParam().open ? 0 : 2);
  EXPECT_EQ(facts.boundary_loops, GetParam().open ? 2U : 0U);
  EXPECT_EQ(facts.degenerate_triangles, 0U);
  const Box box = bounding_box(truth);
  if (GetParam().open) {
    EXPECT_DOUBLE_EQ(box.upper[2], 0.5 * 2.5 * static_cast<double>(phantom.volume.dims[2]));
    EXPECT_DOUBLE_EQ(box.lower[2], -box.upper[2]);
  } else {
    EXPECT_NEAR(phantom_volume(truth), signed_volume(truth), 1e-9 * signed_volume(truth));
  }
}

TEST_P(PhantomOf, TheLongestSideHasTheVoxelsAskedForAndAMargin) {
  for (const Vec3& spacing : {Vec3(1, 1, 1), Vec3(0.8, 0.8, 4), Vec3(3, 0.5, 0.5)}) {
    for (const std::size_t size : {16, 33, 64}) {
      PhantomOptions chosen = options(size);
      chosen.spacing = spacing;
      const Phantom phantom = make_phantom(chosen);
      const auto& dims = phantom.volume.dims;
      EXPECT_EQ(*std::ranges::max_element(dims), size);
      const Mask mask = select(phantom.volume, label_one);
      EXPECT_GT(phantom.inside, 0U);
      for (std::size_t k = 0; k < dims[2]; ++k) {
        for (std::size_t j = 0; j < dims[1]; ++j) {
          for (std::size_t i = 0; i < dims[0]; ++i) {
            const bool border = i == 0 || j == 0 || i + 1 == dims[0] || j + 1 == dims[1] ||
                                (!GetParam().open && (k == 0 || k + 1 == dims[2]));
            ASSERT_FALSE(border && mask(i, j, k));
          }
        }
      }
    }
  }
}

TEST_P(PhantomOf, TheVoxelsComeCloserToTheTruthAsTheyShrink) {
  for (const std::size_t size : {24, 36, 64}) {
    const PhantomOptions chosen = options(size);
    const Phantom phantom = make_phantom(chosen);
    const TriangleMesh truth = phantom_surface(chosen);
    MarchingCubesOptions extraction;
    extraction.open_border = GetParam().open;
    const Mask mask = select(phantom.volume, label_one);
    EXPECT_EQ(piece_sizes(mask).size(), 1U);
    const TriangleMesh surface = marching_cubes(mask, extraction);
    const MeshFacts facts = examine(surface);
    EXPECT_EQ(facts.components, 1U);
    EXPECT_EQ(facts.euler, GetParam().open ? 0 : 2) << size;
    // Half a voxel's diagonal is the most that rounding to voxels can move a surface that is flat at that scale.
    const ClosestPoint tree(truth);
    double worst = 0;
    for (std::size_t v = 0; v < surface.vertices.size(); v += 3) {
      worst = std::max(worst, std::sqrt(tree.closest(surface.vertices[v]).squared_distance));
    }
    EXPECT_LT(worst, 0.5 * std::sqrt(3.0)) << size;
    const double volume = phantom_volume(truth);
    const double error = std::abs(static_cast<double>(phantom.inside) - volume) / volume;
    // Voxels counted by their centres: for a smooth surface the error falls faster than the voxel.
    EXPECT_LT(error, 0.12 * std::pow(area(truth) / volume, 1.5)) << size;
  }
}

TEST_P(PhantomOf, IsTheSameWhateverTheNumberOfThreads) {
  const std::size_t threads = thread_count();
  PhantomOptions chosen = options(40);
  chosen.noise = 0.2;
  set_thread_count(1);
  const Phantom one = make_phantom(chosen);
  set_thread_count(4);
  const Phantom four = make_phantom(chosen);
  set_thread_count(threads);
  EXPECT_EQ(one.volume.data, four.volume.data);
}

TEST(Phantom, TheSphereIsTheFormula) {
  PhantomOptions options;
  options.size = 64;
  options.spacing = Vec3::Constant(0.5);
  const TriangleMesh truth = phantom_surface(options);
  const double radius = 15;
  for (const Vec3& p : truth.vertices) {
    ASSERT_NEAR(p.norm(), radius, 1e-9);
  }
  EXPECT_NEAR(phantom_volume(truth), 4.0 / 3 * M_PI * std::pow(radius, 3), 2e-4 * 14137);
}

TEST(Phantom, NoiseFlipsTheShareOfBorderVoxelsAskedFor) {
  PhantomOptions options;
  options.size = 40;
  const Phantom clean = make_phantom(options);
  EXPECT_EQ(clean.flipped, 0U);
  options.noise = 1;
  const std::size_t border = make_phantom(options).flipped;
  EXPECT_GT(border, 1000U);
  options.noise = 0.25;
  const Phantom noisy = make_phantom(options);
  EXPECT_NEAR(static_cast<double>(noisy.flipped), 0.25 * static_cast<double>(border),
              5 * std::sqrt(0.19 * static_cast<double>(border)));
  options.seed = 2;
  EXPECT_NE(make_phantom(options).volume.data, noisy.volume.data);
  options.seed = 1;
  EXPECT_EQ(make_phantom(options).volume.data, noisy.volume.data);
}

TEST(Phantom, MoreVoxelsThanTheMemoryHoldsAreRefusedAtOnce) {
  PhantomOptions options;
  options.size = 4096;
  options.noise = 0.1;
  const double gib = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 0x1p30;
  if (gib > 127) {
    GTEST_SKIP() << "this machine has memory for the largest phantom";
  }
  try {
    make_phantom(options);
    FAIL() << "128 GiB were taken";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("takes 128.0 GiB"));
    EXPECT_THAT(error.what(), testing::HasSubstr("choose a smaller --size"));
  }
}

TEST(Phantom, OptionsOutOfRangeAreUsageErrors) {
  PhantomOptions options;
  EXPECT_FALSE(phantom_shape("spleen"));
  const auto expect_refused = [](PhantomOptions wrong) { EXPECT_THROW(make_phantom(wrong), UsageError); };
  options.size = 15;
  expect_refused(options);
  options.size = 5000;
  expect_refused(options);
  options.size = 32;
  options.noise = 1.5;
  expect_refused(options);
  options.noise = std::nan("");
  expect_refused(options);
  options.noise = 0;
  options.spacing[1] = 0;
  expect_refused(options);
  options.spacing[1] = std::nan("");
  expect_refused(options);
}

}  // namespace
}  // namespace tunica
