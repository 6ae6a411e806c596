#pragma once

#include "tunica/volume/labels/border_lids.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tunica::cell_layers {

using Word = std::uint64_t;
inline constexpr std::size_t word_bits = 64;

/// The part of an image that is looked at: whole rows.
struct Window {
  std::array<std::size_t, 3> first{0, 0, 0};  ///< outside of the box [first, first + size) no voxel is inside
  std::array<std::size_t, 3> size;            ///< along x that of the image
  std::size_t first_slice = 0;                ///< of the image's values that are at hand
};

/// A box of samples with one layer of samples around it: outside, or with an open border, where the box ends with the
/// image, what the border's samples are. Slices, rows and columns count from this padding on. A padded row is a
/// sequence of words with at least one bit after the samples: with an open border the last sample again, so that no
/// edge towards it is crossed.
class PaddedGrid {
public:
  /// @param lids  where the padding is outside although the border is open; null: nowhere. Lives as long as this
  PaddedGrid(const Mask& mask, const Window& window, bool open, const BorderLids* lids = nullptr);

  [[nodiscard]] std::size_t size(int axis) const { return size_[axis]; }
  [[nodiscard]] std::size_t words() const { return samples_.size(); }
  /// Bits of word `w` of a row that are samples, and those that are the first or the last one.
  [[nodiscard]] Word samples(std::size_t w) const { return samples_[w]; }
  [[nodiscard]] Word ends(std::size_t w) const { return ends_[w]; }
  /// Those that are the first corner of a cell.
  [[nodiscard]] Word cells(std::size_t slice, std::size_t row, std::size_t w) const {
    return slice + 1 < size_[2] && row + 1 < size_[1] ? cells_[w] : 0;
  }
  [[nodiscard]] bool is_cell(std::size_t slice, std::size_t row, std::size_t column) const {
    return slice + 1 < size_[2] && row + 1 < size_[1] && column + 1 < size_[0];
  }
  /// Whether it ends at an open border anywhere.
  [[nodiscard]] bool is_open() const {
    return std::ranges::any_of(open_, [](const auto& sides) { return sides[0] || sides[1]; });
  }

  /// Whether an edge along an axis from a padded sample lies on the image's border: where a lid closes an open border
  /// at the lower side of an axis, the padding itself lies there.
  [[nodiscard]] bool starts_on_lid(std::size_t padded, int axis) const {
    return lids_ != nullptr && padded == 0 && open_[axis][0];
  }

  /// The padded rows of a slice: size(1) x words() words, and for each row whether any sample in it is inside.
  /// @param inside  before: where it is 0 the row is 0 already
  void load(std::size_t slice, Word* out, std::uint8_t* inside) const;

  /// Index among the values at hand of the sample behind a padded one (the nearest, in the padding).
  [[nodiscard]] std::size_t at_hand(const std::array<std::size_t, 3>& padded) const;
  [[nodiscard]] bool is_padding(std::size_t padded, int axis) const { return padded == 0 || padded == size_[axis] - 1; }
  /// Number of a padded sample in the padded image.
  [[nodiscard]] std::size_t number(const std::array<std::size_t, 3>& padded) const;
  /// Voxel coordinate of a padded sample. With an open border the padding lies on the outer voxel faces: half a voxel
  /// out, where the surface ends.
  [[nodiscard]] double coordinate(std::size_t padded, int axis) const;
  [[nodiscard]] const Eigen::Matrix<double, 3, 4>& affine() const { return mask_.affine(); }

private:
  /// Fills the bits around the image's samples, where the border is open.
  void continue_row(Word* row, std::size_t padded_row, std::size_t slice) const;
  /// Takes out of a row of the padding what lids close. @param axis  1 or 2: across which the row is padding
  void put_lids(Word* out, int axis, std::size_t padded, std::size_t other) const;
  [[nodiscard]] std::size_t in_image(std::size_t padded, int axis) const {
    return std::clamp<std::size_t>(padded, 1, size_[axis] - 2) - 1 + window_.first[axis];
  }

  const Mask& mask_;
  Window window_;
  const BorderLids* lids_;
  std::array<std::array<bool, 2>, 3> open_{};  ///< by axis and side
  std::array<std::size_t, 3> size_{};
  std::vector<Word> samples_;
  std::vector<Word> cells_;
  std::vector<Word> ends_;
};

}  // namespace tunica::cell_layers
