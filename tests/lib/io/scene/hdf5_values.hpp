#pragma once

#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>
#include <vector>

namespace tunica::test {

/// All values of a data set, as double.
inline std::vector<double> values(const std::filesystem::path& path, const char* name) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  EXPECT_GE(file, 0) << path;
  const hid_t set = H5Dopen2(file, name, H5P_DEFAULT);
  EXPECT_GE(set, 0) << name;
  const hid_t space = H5Dget_space(set);
  std::vector<double> result(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  EXPECT_GE(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, result.data()), 0);
  H5Sclose(space);
  H5Dclose(set);
  H5Fclose(file);
  return result;
}

/// Whether a group has a link of that name.
inline bool holds(const std::filesystem::path& path, const char* group, const char* name) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  EXPECT_GE(file, 0) << path;
  const hid_t parent = H5Gopen2(file, group, H5P_DEFAULT);
  EXPECT_GE(parent, 0) << group;
  const bool there = H5Lexists(parent, name, H5P_DEFAULT) > 0;
  H5Gclose(parent);
  H5Fclose(file);
  return there;
}

}  // namespace tunica::test
