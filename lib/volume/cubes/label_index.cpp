#include "tunica/volume/cubes/label_index.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/labels/pack_bits.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>
#include <unordered_map>

namespace tunica {
namespace {

template <typename T>
struct Piece {
  T value;
  std::uint32_t at;
  std::uint64_t bits;
};

/// The pieces of up to 64 voxels, one for each value among them (or none for a value of 0, the most frequent one).
template <typename T>
void split_word(const T* values, std::size_t count, std::uint32_t at, bool zero_is_none,
                std::vector<Piece<T>>& pieces) {
  const std::uint64_t all = count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
  bool differ = false;
  for (std::size_t i = 1; i < count; ++i) {
    differ |= values[i] != values[0];
  }
  if (!differ) {
    if (values[0] == values[0] && !(zero_is_none && values[0] == T{0})) {
      pieces.push_back({values[0], at, all});
    }
    return;
  }
  alignas(16) std::uint8_t flags[64] = {};
  for (std::uint64_t rest = all; rest != 0;) {
    const int first = std::countr_zero(rest);
    const T value = values[first];
    for (std::size_t i = 0; i < count; ++i) {
      flags[i] = values[i] == value ? 1 : 0;
    }
    const std::uint64_t bits = pack_bits(flags);
    rest &= ~(bits | std::uint64_t{1} << first);  // NaN is not even equal to itself
    if (bits != 0) {
      pieces.push_back({value, at, bits});
    }
  }
}

}  // namespace

LabelIndex::LabelIndex(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine,
                       std::size_t limit)
    : dims_(dims), affine_(affine), limit_(limit) {
  if ((dims[0] + 63) / 64 * dims[1] * dims[2] > std::numeric_limits<std::uint32_t>::max()) {
    throw InputError("the volume has more than 2^38 voxels, too many for all labels at once: name one label");
  }
}

void LabelIndex::add(const Volume& slab, std::size_t first_slice) {
  TUNICA_ASSERT(slab.dims[0] == dims_[0] && slab.dims[1] == dims_[1] && first_slice + slab.dims[2] <= dims_[2]);
  std::visit([&](const auto& values) { add_values(slab, values, first_slice); }, slab.data);
}

template <typename T>
void LabelIndex::add_values(const Volume& slab, const std::vector<T>& values, std::size_t first_slice) {
  if (image_) {
    return;
  }
  const std::size_t words = (dims_[0] + 63) / 64;
  std::vector<std::vector<Piece<T>>> slices(slab.dims[2]);
  parallel_for_blocks(slab.dims[2], 1, [&](std::size_t k, std::size_t) {
    check_interrupt();
    for (std::size_t j = 0; j < dims_[1]; ++j) {
      const T* const row = values.data() + dims_[0] * (j + dims_[1] * k);
      const std::size_t first_word = words * (j + dims_[1] * (first_slice + k));
      for (std::size_t w = 0; w < words; ++w) {
        split_word(row + 64 * w, std::min<std::size_t>(64, dims_[0] - 64 * w), narrow<std::uint32_t>(first_word + w),
                   slab.intercept == 0, slices[k]);
      }
    }
  });
  // Different stored values may mean the same.
  std::unordered_map<T, Entry*> entry_of;
  for (const auto& slice : slices) {
    for (const auto& [value, at, bits] : slice) {
      const auto [found, fresh] = entry_of.try_emplace(value, nullptr);
      if (fresh) {
        const double meaning = slab.slope * static_cast<double>(value) + slab.intercept;
        found->second = meaning != 0 && !std::isnan(meaning) ? &entries_[meaning] : nullptr;
        if (entries_.size() > limit_) {
          image_ = true;
          entries_.clear();
          return;
        }
      }
      if (found->second == nullptr) {
        continue;
      }
      Entry& entry = *found->second;
      const std::size_t j = at / words % dims_[1];
      const std::size_t k = at / words / dims_[1];
      if (entry.voxels == 0) {
        entry.bounds = {{j, j + 1}, {k, k + 1}};
      }
      entry.bounds.rows = {std::min(entry.bounds.rows[0], j), std::max(entry.bounds.rows[1], j + 1)};
      entry.bounds.slices[1] = k + 1;
      entry.voxels += std::popcount(bits);
      entry.at.push_back(at);
      entry.bits.push_back(bits);
    }
  }
}

std::optional<std::vector<Label>> LabelIndex::labels(const std::vector<std::pair<double, std::string>>& names) const {
  if (image_) {
    return std::nullopt;
  }
  const double voxel_volume = std::abs(affine_.leftCols<3>().determinant());
  std::map<double, std::string> name_of;  // the first of several
  for (const auto& [value, name] : names) {
    name_of.emplace(value, name);
  }
  std::vector<Label> labels;
  for (const auto& [value, entry] : entries_) {
    const auto name = name_of.find(value);
    labels.push_back(
        {value, entry.voxels, real(entry.voxels) * voxel_volume, name == name_of.end() ? std::string{} : name->second});
  }
  return labels;
}

Mask LabelIndex::mask(double label) const {
  Mask mask(dims_, affine_);
  const Entry& entry = entries_.at(label);
  std::uint64_t* const words = mask.row(0, 0);
  for (std::size_t i = 0; i < entry.at.size(); ++i) {
    words[entry.at[i]] |= entry.bits[i];
  }
  return mask;
}

MaskBounds LabelIndex::bounds(double label) const { return entries_.at(label).bounds; }

std::size_t LabelIndex::surface_vertices(double label) const {
  const Entry& entry = entries_.at(label);
  const std::size_t words = (dims_[0] + 63) / 64;
  const std::size_t rows = dims_[1];
  std::size_t pairs = 0;  // neighbours that both have the label
  std::size_t next_row = 0;
  std::size_t next_slice = 0;
  const auto shared = [&](std::size_t& other, std::size_t at, std::uint64_t bits) {
    while (other < entry.at.size() && entry.at[other] < at) {
      ++other;
    }
    return other < entry.at.size() && entry.at[other] == at ? std::popcount(bits & entry.bits[other]) : 0;
  };
  for (std::size_t i = 0; i < entry.at.size(); ++i) {
    const std::size_t at = entry.at[i];
    const std::uint64_t bits = entry.bits[i];
    pairs += std::popcount(bits & (bits >> 1));
    if (at % words + 1 < words && i + 1 < entry.at.size() && entry.at[i + 1] == at + 1) {
      pairs += bits >> 63 & entry.bits[i + 1] & 1;
    }
    if (at / words % rows + 1 < rows) {
      pairs += shared(next_row, at + words, bits);
    }
    pairs += shared(next_slice, at + words * rows, bits);
  }
  return 6 * entry.voxels - 2 * pairs;
}

}  // namespace tunica
