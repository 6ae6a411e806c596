#include "tunica/volume/labels/volume.hpp"

#include "tunica/core/error.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <cmath>
#include <limits>

namespace tunica {

std::size_t voxel_count(const std::array<std::size_t, 3>& dims) {
  // Rows are padded to whole words, surfaces have three edges per voxel, values eight bytes.
  constexpr std::size_t most = std::numeric_limits<std::size_t>::max() / 128;
  std::size_t count = 1;
  for (const std::size_t size : dims) {
    if (size == 0) {
      throw InputError("the volume has no voxels");
    }
    if (__builtin_mul_overflow(count, size, &count) || count > most) {
      throw InputError(fmt::format("a volume of {} x {} x {} voxels is impossible", dims[0], dims[1], dims[2]));
    }
  }
  return count;
}

void require_affine(const Eigen::Matrix<double, 3, 4>& affine) {
  const double determinant = affine.leftCols<3>().determinant();
  if (!affine.allFinite() || determinant == 0 || !std::isfinite(determinant)) {
    throw InputError("the volume's orientation matrix has no inverse: its voxels have no extent in some direction");
  }
}

void require_volume(const Volume& volume) {
  const std::size_t count = voxel_count(volume.dims);
  const std::size_t values = std::visit([](const auto& data) { return data.size(); }, volume.data);
  if (values != count) {
    throw InputError(fmt::format("the volume has {} values for {} voxels", values, count));
  }
  require_affine(volume.affine);
  if (!std::isfinite(volume.slope) || volume.slope == 0 || !std::isfinite(volume.intercept)) {
    throw InputError("the volume's scaling (slope, intercept) is zero or not finite");
  }
}

void require_slab(const Volume& slab, std::size_t first_slice, const std::array<std::size_t, 3>& dims) {
  require_volume(slab);
  if (slab.dims[0] != dims[0] || slab.dims[1] != dims[1] || first_slice > dims[2] ||
      slab.dims[2] > dims[2] - first_slice) {
    throw InputError(fmt::format("slices {} to {} of {} x {} voxels are not of a volume of {} x {} x {}", first_slice,
                                 first_slice + slab.dims[2] - 1, slab.dims[0], slab.dims[1], dims[0], dims[1],
                                 dims[2]));
  }
}

}  // namespace tunica
