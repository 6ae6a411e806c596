#include "tunica/volume/labels/components.hpp"

#include "mesh_check.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tunica {
namespace {

using test::check_mesh;
using test::label_one;
using test::make_volume;
using test::Random;

Mask random_mask(const std::array<std::size_t, 3>& dims, double density, Random& random) {
  return select(make_volume<std::uint8_t>(dims, [&](auto...) { return random.uniform() < density; }), label_one);
}

TEST(Components, PiecesAndCavitiesAreTheComponentsOfTheSurface) {
  Random random(21);
  for (const double density : {0.1, 0.3, 0.5, 0.7, 0.85, 0.95}) {
    for (int trial = 0; trial < 5; ++trial) {
      Mask mask = random_mask({66, 9, 11}, density, random);
      const std::size_t pieces = piece_sizes(mask).size();
      const std::size_t components = check_mesh(marching_cubes(mask)).components;
      const std::size_t cavities = fill_cavities(mask);
      EXPECT_EQ(pieces + cavities, components) << density;
      EXPECT_EQ(check_mesh(marching_cubes(mask)).components, piece_sizes(mask).size());
      EXPECT_EQ(fill_cavities(mask), 0U);
    }
  }
}

TEST(Components, TheLargestPieceStays) {
  Random random(22);
  for (int trial = 0; trial < 10; ++trial) {
    Mask mask = random_mask({40, 12, 13}, 0.25, random);
    const std::vector<std::size_t> sizes = piece_sizes(mask);
    EXPECT_EQ(keep_largest_piece(mask), sizes.size() - 1);
    EXPECT_EQ(piece_sizes(mask), std::vector<std::size_t>{sizes[0]});
    EXPECT_EQ(count_voxels(mask), sizes[0]);
  }
}

TEST(Components, PiecesThatTouchInAnEdgeAreTwo) {
  const Mask mask =
      select(make_volume<std::uint8_t>({2, 2, 1}, [](auto i, auto j, auto) { return i == j; }), label_one);
  EXPECT_EQ(piece_sizes(mask), (std::vector<std::size_t>{1, 1}));
}

TEST(Components, ACavityLeaksThroughAnEdgeButNotThroughACorner) {
  const auto block_with_hole = [](std::array<std::size_t, 3> second) {
    return select(make_volume<std::uint8_t>({4, 4, 4},
                                            [&](std::size_t i, std::size_t j, std::size_t k) {
                                              const std::array<std::size_t, 3> at{i, j, k};
                                              return at != std::array<std::size_t, 3>{1, 1, 1} && at != second;
                                            }),
                  label_one);
  };
  Mask edge = block_with_hole({0, 0, 1});
  EXPECT_EQ(fill_cavities(edge), 0U);
  Mask corner = block_with_hole({0, 0, 0});
  EXPECT_EQ(fill_cavities(corner), 1U);
  EXPECT_EQ(count_voxels(corner), 63U);
}

TEST(Components, EditedPiecesOfAGreyVolumeStayAManifold) {
  Random random(23);
  const Volume volume = make_volume<float>({30, 31, 32}, [&](auto i, auto j, auto k) {
    return std::sin(0.7 * static_cast<double>(i)) + std::sin(0.8 * static_cast<double>(j)) +
           std::sin(0.6 * static_cast<double>(k)) + random.uniform();
  });
  for (const double value : {-1.2, 0.5, 1.7}) {
    Mask mask = select(volume, test::above(value));
    keep_largest_piece(mask);
    fill_cavities(mask);
    const auto check = check_mesh(marching_cubes(volume, test::above(value), mask));
    EXPECT_TRUE(check.closed() && check.manifold());
    EXPECT_EQ(check.components, 1U);
  }
}

TEST(Components, NothingInsideIsNoPiece) {
  Mask mask({5, 5, 5}, Eigen::Matrix<double, 3, 4>::Identity());
  EXPECT_TRUE(piece_sizes(mask).empty());
  EXPECT_EQ(keep_largest_piece(mask), 0U);
  EXPECT_EQ(fill_cavities(mask), 0U);
}

}  // namespace
}  // namespace tunica
