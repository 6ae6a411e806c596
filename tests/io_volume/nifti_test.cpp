#include "core/error.hpp"
#include "io/volume_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace tunica {
namespace {

TEST(Nifti, WhatIsWrittenIsReadBack) {
  const auto path = std::filesystem::temp_directory_path() / "tunica_nifti.nii.gz";
  Volume volume;
  volume.dims = {3, 4, 5};
  std::vector<std::int16_t> values(60);
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = static_cast<std::int16_t>(i * 7) - 100;
  }
  volume.data = values;
  volume.affine << 0.5, 0, 0, 1, 0, 2, 0, -3, 0, 0, 4, 7;
  write_nifti(path, volume, true);
  const VolumeFile file = read_volume(path);
  EXPECT_EQ(file.volume.dims, volume.dims);
  EXPECT_EQ(std::get<std::vector<std::int16_t>>(file.volume.data), values);
  EXPECT_TRUE(file.volume.affine.isApprox(volume.affine));
  EXPECT_EQ(file.orientation, "LPS");
  EXPECT_TRUE(file.warnings.empty());
}

}  // namespace
}  // namespace tunica
