#pragma once

#include "tunica/core/types.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace tunica {

/// A voxel volume in the machine's memory. Voxel (i, j, k) is data[i + dims[0] * (j + dims[1] * k)].
struct Volume {
  using Data =
      std::variant<std::vector<std::uint8_t>, std::vector<std::int8_t>, std::vector<std::uint16_t>,
                   std::vector<std::int16_t>, std::vector<std::uint32_t>, std::vector<std::int32_t>,
                   std::vector<std::uint64_t>, std::vector<std::int64_t>, std::vector<float>, std::vector<double>>;

  std::array<std::size_t, 3> dims{0, 0, 0};
  Data data;  ///< stored values; the meaning of v is slope * v + intercept
  double slope = 1;
  double intercept = 0;
  /// Voxel index (i, j, k) of a voxel's centre to world millimetres, LPS, rows x y z.
  Eigen::Matrix<double, 3, 4> affine = Eigen::Matrix<double, 3, 4>::Identity();
  /// Names of labels where the file has them (.seg.nrrd, NIfTI's header extension), by label value.
  std::vector<std::pair<double, std::string>> label_names;

  [[nodiscard]] std::size_t voxels() const { return dims[0] * dims[1] * dims[2]; }
};

/// The number of voxels. Errors: InputError: a dimension is 0, or there are more than memory can number.
std::size_t voxel_count(const std::array<std::size_t, 3>& dims);

/// Errors: InputError: the affine is not finite or has no inverse.
void require_affine(const Eigen::Matrix<double, 3, 4>& affine);

/// Checks that a volume is one: dims, data of that size, affine, slope and intercept. Errors: InputError.
void require_volume(const Volume& volume);

/// As require_volume(), of slices [first_slice, first_slice + slab.dims[2]) of a volume of `dims`.
void require_slab(const Volume& slab, std::size_t first_slice, const std::array<std::size_t, 3>& dims);

}  // namespace tunica
