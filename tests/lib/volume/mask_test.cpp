#include "tunica/volume/labels/mask.hpp"
#include "tunica/volume/labels/whole_labels.hpp"

#include "mesh_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

namespace tunica {
namespace {

/// Random bit patterns and the ends of the type, next to whole numbers.
template <typename T>
std::vector<T> awkward_values() {
  test::Random random(99);
  std::vector<T> values;
  for (int i = 0; i < 500; ++i) {
    const std::uint64_t bits = random.bits();
    T value;
    std::memcpy(&value, &bits, sizeof value);
    values.push_back(value);
    values.push_back(static_cast<T>(i % 12));
  }
  values.insert(values.end(), {std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max(), T{0}, T{1}});
  if constexpr (std::is_floating_point_v<T>) {
    values.insert(values.end(),
                  {std::numeric_limits<T>::infinity(), -std::numeric_limits<T>::infinity(),
                   std::numeric_limits<T>::quiet_NaN(), static_cast<T>(-0.0), std::numeric_limits<T>::denorm_min()});
  }
  return values;
}

template <typename T>
class MaskOfType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t, std::int32_t,
                             std::uint64_t, std::int64_t, float, double>;
TYPED_TEST_SUITE(MaskOfType, Types);

TYPED_TEST(MaskOfType, AgreesWithTheRuleVoxelByVoxel) {
  Volume volume;
  const auto values = awkward_values<TypeParam>();
  volume.dims = {values.size(), 1, 1};
  volume.data = values;
  for (const auto& [slope, intercept] :
       std::vector<std::pair<double, double>>{{1, 0}, {2, 1}, {-1, 0}, {-0.5, 3}, {0.1, -1000}, {1e300, 0}}) {
    volume.slope = slope;
    volume.intercept = intercept;
    for (const double value : {0.0, 1.0, 3.0, -1.0, 0.5, 128.0, 255.0, 1e30, -1e300}) {
      const Mask label = select(volume, {Inside::Rule::label, value});
      const Mask above = select(volume, {Inside::Rule::above, value});
      const Mask below = select(volume, {Inside::Rule::below, value});
      for (std::size_t i = 0; i < values.size(); ++i) {
        const volatile double scaled = slope * static_cast<double>(values[i]);
        const long double meaning =
            slope == 1 ? static_cast<long double>(values[i]) : static_cast<long double>(scaled + intercept);
        const bool rounded = slope != 1 || std::is_floating_point_v<TypeParam>;
        const bool is_label = rounded ? label_meant(static_cast<double>(meaning)) == value : meaning == value;
        ASSERT_EQ(label(i, 0, 0), is_label) << slope << ' ' << value << ' ' << +values[i];
        ASSERT_EQ(above(i, 0, 0), meaning > value) << slope << ' ' << value << ' ' << +values[i];
        ASSERT_EQ(below(i, 0, 0), meaning < value) << slope << ' ' << value << ' ' << +values[i];
      }
    }
  }
}

TYPED_TEST(MaskOfType, CountsWhatIsNoFiniteNumber) {
  Volume volume;
  const auto values = awkward_values<TypeParam>();
  volume.dims = {values.size(), 1, 1};
  volume.data = values;
  std::size_t expected = 0;
  for (const TypeParam value : values) {
    expected += std::isfinite(static_cast<double>(value)) ? 0 : 1;
  }
  EXPECT_EQ(count_not_finite(volume), expected);
  EXPECT_EQ(expected >= 3, std::is_floating_point_v<TypeParam>);
}

TEST(Mask, NeighbouringLabelsBeyondDoublePrecisionStayApart) {
  Volume volume;
  volume.dims = {3, 1, 1};
  const std::uint64_t big = std::uint64_t{1} << 53;
  volume.data = std::vector<std::uint64_t>{big - 1, big, big + 1};
  const Mask mask = select(volume, {Inside::Rule::label, 0x1p53});
  EXPECT_FALSE(mask(0, 0, 0));
  EXPECT_TRUE(mask(1, 0, 0));
  EXPECT_FALSE(mask(2, 0, 0));
}

TEST(Mask, CountsVoxelsAndTheirVolume) {
  Volume volume;
  volume.dims = {65, 3, 2};
  volume.data = std::vector<std::uint8_t>(65 * 3 * 2, 7);
  volume.affine.leftCols<3>() << -0.5, 0, 0, 0, 0, 2, 0, 3, 0;
  const Mask mask = select(volume, {Inside::Rule::label, 7});
  EXPECT_EQ(count_voxels(mask), 65U * 3 * 2);
  EXPECT_DOUBLE_EQ(mask.voxel_volume(), 3);
}

TEST(Mask, CountsWhatTheBorderCutsAndWhatDiffers) {
  Mask mask({130, 5, 4}, Volume().affine);
  mask.set(64, 2, 1, true);
  EXPECT_EQ(count_at_border(mask), 0U);
  const Mask before = mask;
  for (const auto& [i, j, k] :
       {std::array<std::size_t, 3>{0, 2, 1}, {129, 2, 2}, {64, 0, 1}, {64, 4, 2}, {3, 2, 0}, {129, 4, 3}}) {
    mask.set(i, j, k, true);
  }
  EXPECT_EQ(count_at_border(mask), 6U);
  EXPECT_EQ(count_differing(mask, before), 6U);
  EXPECT_EQ(count_differing(mask, mask), 0U);
  Mask slice({3, 3, 1}, Volume().affine);  // its middle is not at a border, though there is but one slice
  slice.set(1, 1, 0, true);
  EXPECT_EQ(count_at_border(slice), 0U);
  slice.set(2, 1, 0, true);
  EXPECT_EQ(count_at_border(slice), 1U);
}

TEST(Mask, IsUnitedAndLosesWhatLiesBeyondAPlane) {
  Volume volume;
  volume.affine << -2, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0;
  Mask mask({70, 2, 2}, volume.affine);
  Mask other = mask;
  mask.set(3, 0, 1, true);    // x = 4
  other.set(69, 1, 0, true);  // x = -128
  unite(mask, other);
  EXPECT_EQ(count_voxels(mask), 2U);
  drop_beyond(mask, Vec3::UnitX(), 4);
  EXPECT_EQ(count_voxels(mask), 2U);
  drop_beyond(mask, -Vec3::UnitX(), 127.5);
  EXPECT_TRUE(mask(3, 0, 1));
  EXPECT_FALSE(mask(69, 1, 0));
  EXPECT_THROW(unite(mask, Mask({3, 3, 1}, volume.affine)), InputError);
}

}  // namespace
}  // namespace tunica
