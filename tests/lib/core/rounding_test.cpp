#include "tunica/core/rounding.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace tunica {
namespace {

TEST(RoundedUpwards, HasSoManyDigits) {
  EXPECT_DOUBLE_EQ(rounded_upwards(0.13348, 3), 0.134);
  EXPECT_DOUBLE_EQ(rounded_upwards(0.114634, 4), 0.1147);
  EXPECT_DOUBLE_EQ(rounded_upwards(0.3, 3), 0.3);
  EXPECT_DOUBLE_EQ(rounded_upwards(9.9999, 3), 10);
  EXPECT_DOUBLE_EQ(rounded_upwards(123456, 3), 124000);
}

TEST(RoundedUpwards, IsNeverBelow) {
  for (double value = 1e-9; value < 1e9; value *= 1.37) {
    EXPECT_GE(std::stod(fmt::format("{:.3g}", rounded_upwards(value, 3))), value * (1 - 1e-12));
    EXPECT_LE(rounded_upwards(value, 3), value * 1.0101);
  }
}

TEST(RoundedUpwards, LeavesWhatIsNoPositiveNumber) {
  EXPECT_EQ(rounded_upwards(0, 3), 0);
  EXPECT_EQ(rounded_upwards(-1.2345, 3), -1.2345);
  EXPECT_TRUE(std::isnan(rounded_upwards(std::numeric_limits<double>::quiet_NaN(), 3)));
  EXPECT_TRUE(std::isinf(rounded_upwards(std::numeric_limits<double>::infinity(), 3)));
}

}  // namespace
}  // namespace tunica
