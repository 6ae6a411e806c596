#include "tunica/volume/labels/hollows.hpp"

#include "mesh_check.hpp"
#include "tunica/core/error.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/components.hpp"
#include "tunica/volume/labels/shelter.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace tunica {
namespace {

using test::label_one;
using test::make_volume;

template <typename Value>
Mask make_mask(const std::array<std::size_t, 3>& dims, const Value& value) {
  return select(make_volume<std::uint8_t>(dims,
                                          [&](std::size_t i, std::size_t j, std::size_t k) {
                                            return value(static_cast<double>(i), static_cast<double>(j),
                                                         static_cast<double>(k));
                                          }),
                label_one);
}

bool ring(double x, double y, double inner, double outer) {
  const double r = std::hypot(x, y);
  return r >= inner && r < outer;
}

TEST(Hollows, ATubeThatTheBorderCutsEnclosesItsLumen) {
  for (const double outer : {12.0, 10.2}) {  // 3 voxels, and little more than one
    const Mask wall = make_mask({33, 33, 20}, [&](auto x, auto y, auto) { return ring(x - 16, y - 16, 9, outer); });
    const Hollows hollows = find_hollows(wall);
    const Mask lumen = make_mask({33, 33, 20}, [&](auto x, auto y, auto) { return ring(x - 16, y - 16, 0, 9); });
    ASSERT_EQ(hollows.sizes.size(), 1U);
    EXPECT_FALSE(hollows.closed);
    EXPECT_EQ(inner_solid(hollows), lumen);
    EXPECT_EQ(outer_solid(wall, hollows),
              make_mask({33, 33, 20}, [&](auto x, auto y, auto) { return ring(x - 16, y - 16, 0, outer); }));
    EXPECT_NEAR(hollows.share, 81 / (outer * outer), 0.04);
    EXPECT_LT((hollows.middle - Vec3(16, 16, 9.5)).norm(), 1e-9);
  }
}

TEST(Hollows, AlsoWhereTheImageIsCroppedToTheTubeOrOneEndIsClosed) {
  const Mask tight = make_mask({25, 25, 20}, [](auto x, auto y, auto) { return ring(x - 12, y - 12, 9, 12.6); });
  EXPECT_EQ(find_hollows(tight).sizes.size(), 1U);
  EXPECT_NEAR(find_hollows(tight).share, 81.0 / (12.6 * 12.6), 0.04);
  const Mask cup = make_mask({33, 33, 20},
                             [](auto x, auto y, auto z) { return ring(x - 16, y - 16, z > 15 ? 0 : 9, 12) && z < 18; });
  EXPECT_EQ(find_hollows(cup).sizes.size(), 1U);
  EXPECT_GT(find_hollows(cup).share, 0.4);
  // Cut lengthwise, so that the lumen runs over an edge of the image.
  const Mask half = make_mask({33, 20, 30}, [](auto x, auto y, auto) { return ring(x - 16, y + 0.5, 9, 12); });
  EXPECT_EQ(find_hollows(half).sizes.size(), 1U);
}

TEST(Hollows, AWallOfOneVoxelIsTightThoughItsCavityLeaksAcrossEdges) {
  const auto radius = [](double x, double y, double z) { return std::hypot(x - 17, y - 17, z - 17); };
  const Mask wall = make_mask({35, 35, 35}, [&](auto... at) { return std::abs(radius(at...) - 14) < 0.5; });
  Mask filled = wall;
  EXPECT_EQ(fill_cavities(filled), 0U);
  const Hollows hollows = find_hollows(wall);
  ASSERT_EQ(hollows.sizes.size(), 1U);
  EXPECT_TRUE(hollows.closed);
  const auto inner = test::check_mesh(marching_cubes(inner_solid(hollows)));
  EXPECT_TRUE(inner.closed() && inner.manifold());
  EXPECT_EQ(inner.components, 1U);
  EXPECT_GT(inner.volume, 0);
}

TEST(Hollows, SolidsEncloseNothing) {
  const auto ball = [](double x, double y, double z) { return std::hypot(x - 12, y - 12, z - 12) < 9; };
  EXPECT_TRUE(find_hollows(make_mask({25, 25, 25}, ball)).sizes.empty());
  EXPECT_TRUE(find_hollows(make_mask({12, 25, 25}, ball)).sizes.empty());  // cut
  // A vessel right across the image, and a slab that parts it in two.
  EXPECT_TRUE(find_hollows(make_mask({25, 25, 20}, [](auto x, auto y, auto) {
                return ring(x - 12, y - 12, 0, 8);
              })).sizes.empty());
  EXPECT_TRUE(find_hollows(make_mask({25, 25, 25}, [](auto, auto, auto z) { return z > 9 && z < 16; })).sizes.empty());
  EXPECT_TRUE(find_hollows(Mask({5, 5, 5}, Eigen::Matrix<double, 3, 4>::Identity())).sizes.empty());
  EXPECT_TRUE(find_hollows(make_mask({5, 5, 5}, [](auto...) { return true; })).sizes.empty());
  // A bend from which the border parts what lies between its legs.
  const Mask bend = make_mask(
      {41, 21, 21}, [](auto x, auto y, auto z) { return std::hypot(std::hypot(x - 20, y) - 14, z - 10) < 5; });
  EXPECT_LT(find_hollows(bend).share, 0.1);
}

TEST(Hollows, SmallGapsDoNotCountAndIslandsBelongToTheLumen) {
  const auto radius = [](double x, double y, double z) { return std::hypot(x - 17, y - 17, z - 17); };
  const Mask wall = make_mask({35, 35, 35}, [&](double x, double y, double z) {
    const double r = radius(x, y, z);
    const bool gap = x == 2 + 17 - 15 && y == 17 && z == 17;
    return (r < 15 && r >= 11 && !gap) || r < 2;
  });
  const Hollows hollows = find_hollows(wall);
  EXPECT_EQ(hollows.sizes.size(), 1U);
  const auto inner = test::check_mesh(marching_cubes(inner_solid(hollows)));
  EXPECT_EQ(inner.components, 1U);
  const auto outer = test::check_mesh(marching_cubes(outer_solid(wall, hollows)));
  EXPECT_EQ(outer.components, 1U);
  EXPECT_THROW(outer_solid(Mask({3, 3, 3}, wall.affine()), hollows), InputError);
}

// Whatever axes it lies along, and wherever words of 64 columns end.
Shelter shelter_turned(int turn, double shift, const std::function<bool(double, double, double)>& solid) {
  return find_shelter(make_mask({33 + 60, 33 + 60, 33 + 60}, [&](double x, double y, double z) {
    x -= shift;
    y -= shift;
    z -= shift;
    return turn == 0 ? solid(x, y, z) : turn == 1 ? solid(y, z, x) : solid(z, x, y);
  }));
}

TEST(Shelter, ShowsAWallThatIsOpenWithinTheImage) {
  const auto cup = [](double x, double y, double z) {
    const double r = std::hypot(x - 16, y - 16, z - 16);
    return r < 13 && r >= 11 && z < 18;
  };
  EXPECT_TRUE(find_hollows(make_mask({33, 33, 33}, cup)).sizes.empty());
  const auto ball = [](double x, double y, double z) { return std::hypot(x - 16, y - 16, z - 16) < 13; };
  for (int turn = 0; turn < 3; ++turn) {
    for (const double shift : {0.0, 30.0, 60.0}) {
      const Shelter shelter = shelter_turned(turn, shift, cup);
      EXPECT_GT(shelter.share, 0.4) << turn;
      EXPECT_LT((shelter.middle - Vec3(16 + shift, 16 + shift, 16 + shift)).norm(), 6);
      EXPECT_LT(shelter_turned(turn, shift, ball).share, 0.01);
    }
  }
  EXPECT_EQ(find_shelter(Mask({5, 5, 5}, Eigen::Matrix<double, 3, 4>::Identity())).share, 0);
}

TEST(Shelter, ShowsATubeWithASlitAsFarAsAThirdOfItIsOpen) {
  for (const bool cut : {true, false}) {
    for (const double outer : {10.3, 12.0, 15.0}) {
      for (const double open : {3.0, 30.0, 90.0, 120.0}) {
        if (!cut && open > 90) {
          continue;  // with its ends open too, a thick wall has too little in its shelter
        }
        const auto tube = [&](double x, double y, double z) {
          const double angle = std::abs(std::atan2(y - 16, x - 16)) * 180 / 3.14159265358979;
          return ring(x - 16, y - 16, 9, outer) && angle >= open / 2 && (cut || (z > 4 && z < 40));
        };
        const Mask wall = make_mask({33, 33, 45}, tube);
        EXPECT_TRUE(find_hollows(wall).sizes.empty());
        EXPECT_GT(find_shelter(wall).share, 0.25) << cut << " " << outer << " " << open;
      }
    }
  }
}

TEST(Shelter, OfSolidsIsSmall) {
  const auto share = [](const auto& solid) {
    return find_shelter(
               make_mask({41, 41, 41}, [&](double x, double y, double z) { return solid(x - 20, y - 20, z - 20); }))
        .share;
  };
  const auto torus = [](double x, double y, double z) { return std::hypot(std::hypot(x, y) - 13, z) < 5; };
  EXPECT_LT(share(torus), 0.02);
  EXPECT_LT(share([&](auto x, auto y, auto z) { return torus(x, y, z) && x < 0; }), 0.02);
  // A horseshoe that is nearly closed, a plate, a bent plate, a rod, and a kidney.
  EXPECT_LT(share([&](auto x, auto y, auto z) { return torus(x, y, z) && (x < 10 || std::abs(y) > 2); }), 0.02);
  EXPECT_LT(share([](auto x, auto y, auto z) { return std::hypot(x, y) < 18 && std::abs(z) < 3; }), 0.02);
  EXPECT_LT(share([](auto x, auto y, auto z) { return ring(x, z, 15, 18) && std::abs(y) < 15 && z > 3; }), 0.25);
  EXPECT_LT(share([](auto x, auto y, auto z) { return std::hypot(x - 0.4 * z, y) < 5; }), 0.02);
  EXPECT_LT(share([](auto x, auto y, auto z) {
              return std::hypot(x / 10, y / 8, z / 18) < 1 && std::hypot((x - 9) / 6, y / 5, z / 7) >= 1;
            }),
            0.1);
}

TEST(Bridge, OfOneVoxelBetweenTwoVesselsIsFound) {
  const auto vessels = [](double x, double y, double z) {
    return std::hypot(x - 8, y - 12) < 6 || std::hypot(x - 22, y - 12) < 6 ||
           (x >= 13 && x <= 16 && y == 12 && z == 17);
  };
  const auto bridge = find_bridge(make_mask({31, 25, 40}, vessels));
  ASSERT_TRUE(bridge);
  EXPECT_LT((bridge->place - Vec3(15, 12, 17)).cwiseAbs().maxCoeff(), 1.6);
  EXPECT_EQ(bridge->section, 1U);
  EXPECT_GT(bridge->share, 0.25);
}

TEST(Bridge, ThereIsNoneWhereOrgansAreOneOrApart) {
  const auto two = [](double x, double y, double) {
    return std::hypot(x - 8, y - 12) < 6 || std::hypot(x - 22, y - 12) < 6;
  };
  EXPECT_FALSE(find_bridge(make_mask({31, 25, 40}, two)));
  // A neck of five voxels, and a small part beside a large one.
  EXPECT_FALSE(find_bridge(make_mask({31, 25, 40}, [&](double x, double y, double z) {
    return two(x, y, z) || (x >= 8 && x <= 22 && std::abs(y - 12) <= 2 && std::abs(z - 17) <= 2);
  })));
  EXPECT_FALSE(find_bridge(make_mask({31, 25, 40}, [&](double x, double y, double z) {
    return std::hypot(x - 8, y - 12) < 6 || std::hypot(x - 20, y - 12, z - 17) < 4 ||
           (x >= 13 && x <= 17 && y == 12 && z == 17);
  })));
  EXPECT_FALSE(find_bridge(Mask({5, 5, 5}, Eigen::Matrix<double, 3, 4>::Identity())));
}

}  // namespace
}  // namespace tunica
