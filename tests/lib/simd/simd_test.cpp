#include "tunica/core/lanes.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <array>
#include <cmath>

namespace tunica {
namespace {

std::array<double, lane_count> values_of(const Lanes& lanes) {
  std::array<double, lane_count> values;
  lanes.copy_to(values.data(), simd::element_aligned);
  return values;
}

const Lanes counted([](auto k) { return static_cast<double>(static_cast<std::size_t>(k)) + 1; });  // 1, 2, 3, 4

TEST(Simd, ArithmeticIsThatOfEachNumber) {
  const Lanes result = (2 * counted - 1) / counted + -counted * 0.5;
  for (std::size_t k = 0; k < lane_count; ++k) {
    const double x = static_cast<double>(k) + 1;
    EXPECT_DOUBLE_EQ(result[k], (2 * x - 1) / x - 0.5 * x);
  }
  Lanes changed = counted;
  changed += 1;
  changed *= counted;
  changed -= Lanes(2);
  changed /= 2.0;
  EXPECT_EQ(values_of(changed), (std::array<double, lane_count>{0, 2, 5, 9}));
  changed[2] = -7;
  EXPECT_EQ(changed[2], -7);
  EXPECT_EQ(changed[3], 9);
}

TEST(Simd, FunctionsAreThoseOfEachNumber) {
  const Lanes other([](auto k) { return static_cast<std::size_t>(k) % 2 == 0 ? -9.0 : 9.0; });
  EXPECT_EQ(values_of(simd::min(counted, other)), (std::array<double, lane_count>{-9, 2, -9, 4}));
  EXPECT_EQ(values_of(simd::max(counted, other)), (std::array<double, lane_count>{1, 9, 3, 9}));
  EXPECT_EQ(values_of(simd::abs(other)), (std::array<double, lane_count>{9, 9, 9, 9}));
  EXPECT_EQ(values_of(simd::sqrt(counted * counted)), values_of(counted));
  EXPECT_EQ(simd::reduce(counted), 10);
}

TEST(Simd, MasksChooseNumbers) {
  const LaneMask some = counted > 1.0 && !(counted >= 4.0);
  Lanes chosen = counted;
  simd::where(some, chosen) = -counted;
  EXPECT_EQ(values_of(chosen), (std::array<double, lane_count>{1, -2, -3, 4}));
  EXPECT_TRUE(simd::any_of(some));
  EXPECT_FALSE(simd::all_of(some));
  EXPECT_FALSE(simd::none_of(some));
  EXPECT_TRUE(simd::none_of(counted < 1.0 || counted != counted));
  EXPECT_TRUE(simd::all_of(counted <= 4.0 && counted == counted));
}

TEST(Simd, NumbersComeFromAndGoToMemory) {
  const std::array<double, lane_count + 1> memory{0, 5, 6, 7, 8};
  const Lanes lanes(memory.data() + 1, simd::element_aligned);
  EXPECT_EQ(values_of(lanes), (std::array<double, lane_count>{5, 6, 7, 8}));
  const simd::Vector<float, 8> floats([](auto k) { return static_cast<float>(static_cast<std::size_t>(k)); });
  EXPECT_EQ(simd::reduce(floats), 28.0F);
}

TEST(Simd, TheyAreScalarsOfEigensMatrices) {
  const LaneVec3 a(counted, Lanes(2), 0.5 * counted);
  const LaneVec3 b = LaneVec3::Ones();
  const LaneVec3 cross = a.cross(b);
  const Lanes length = a.norm();
  for (std::size_t k = 0; k < lane_count; ++k) {
    const double x = static_cast<double>(k) + 1;
    const Eigen::Vector3d one(x, 2, 0.5 * x);
    EXPECT_NEAR(length[k], one.norm(), 1e-15 * one.norm());
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_DOUBLE_EQ(cross[i][k], one.cross(Eigen::Vector3d::Ones())[i]);
    }
  }
}

}  // namespace
}  // namespace tunica
