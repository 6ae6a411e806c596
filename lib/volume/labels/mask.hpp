#pragma once

#include "tunica/core/fresh_memory.hpp"
#include "tunica/volume/labels/volume.hpp"

#include <cstdint>
#include <vector>

namespace tunica {

/// In voxels: how far rounding may take a coordinate from the grid, or from the image's faces, on which it lies.
inline constexpr double on_grid = 1e-6;

/// Which samples of a volume are inside, by what they mean (slope * v + intercept). NaN is outside, whatever the rule.
struct Inside {
  enum class Rule {
    label,  ///< label_meant() of it is `value`: a whole number also takes what misses it by rounding
    above,  ///< greater than `value`; a sample equal to it is outside
    below,  ///< less than `value`; a sample equal to it is outside
  };
  Rule rule = Rule::above;
  double value = 0;
};

/// A selection of voxels: one bit per voxel, rows of whole words along i, so an eighth of the smallest volume.
class Mask {
public:
  /// All voxels outside. Errors: InputError when a dimension is 0 or the affine has no inverse.
  Mask(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine);

  [[nodiscard]] const std::array<std::size_t, 3>& dims() const { return dims_; }
  /// Voxel index (i, j, k) to world millimetres, as in Volume.
  [[nodiscard]] const Eigen::Matrix<double, 3, 4>& affine() const { return affine_; }
  /// Volume of one voxel, mm^3, positive.
  [[nodiscard]] double voxel_volume() const;

  [[nodiscard]] std::size_t words_per_row() const { return words_per_row_; }
  /// Bit i % 64 of word i / 64 is voxel (i, j, k); bits from dims[0] on are 0.
  [[nodiscard]] const std::uint64_t* row(std::size_t j, std::size_t k) const {
    return words_.data() + (j + dims_[1] * k) * words_per_row_;
  }
  [[nodiscard]] std::uint64_t* row(std::size_t j, std::size_t k) {
    return words_.data() + (j + dims_[1] * k) * words_per_row_;
  }
  [[nodiscard]] bool operator()(std::size_t i, std::size_t j, std::size_t k) const {
    return (row(j, k)[i / 64] >> (i % 64) & 1) != 0;
  }
  void set(std::size_t i, std::size_t j, std::size_t k, bool inside) {
    const std::uint64_t bit = std::uint64_t{1} << (i % 64);
    std::uint64_t& word = row(j, k)[i / 64];
    word = inside ? word | bit : word & ~bit;
  }

  friend bool operator==(const Mask& a, const Mask& b) { return a.dims_ == b.dims_ && a.words_ == b.words_; }

private:
  std::array<std::size_t, 3> dims_;
  std::size_t words_per_row_;
  Eigen::Matrix<double, 3, 4> affine_;
  std::vector<std::uint64_t, ZeroedAllocator<std::uint64_t>> words_;
};

/// The voxels that are inside by `rule`. Exact: integers are compared as integers where the volume has no scaling, and
/// no rounding of slope * v + intercept depends on the machine.
/// Errors: InputError: require_volume(); a rule whose value is not-a-number.
/// Cost: one pass over the volume.
Mask select(const Volume& volume, const Inside& rule);

/// The same for the slices [first_slice, first_slice + slab.dims[2]) of a larger volume, into its mask.
void select(const Volume& slab, std::size_t first_slice, const Inside& rule, Mask& mask);

/// Number of samples that are no finite number: NaN, or infinite. Of whole numbers none is. Cost: one pass. Parallel.
std::size_t count_not_finite(const Volume& volume);

/// Number of voxels inside.
std::size_t count_voxels(const Mask& mask);

/// Number of voxels inside that the image's border cuts: the first and last along an axis of more than one.
std::size_t count_at_border(const Mask& mask);

/// What is inside in the other one comes in, too. Errors: InputError: different dimensions.
void unite(Mask& mask, const Mask& other);

/// Voxels whose middles lie beyond a plane, where normal . x > offset (mm), become outside. Cost: one pass.
void drop_beyond(Mask& mask, const Vec3& normal, double offset);

/// Number of voxels that are inside in one mask and outside in the other. Errors: InputError: different dimensions.
std::size_t count_differing(const Mask& a, const Mask& b);

}  // namespace tunica
