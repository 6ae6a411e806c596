#include "tunica/volume/cubes/label_index.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/labels/pack_bits.hpp"
#include "tunica/volume/labels/whole_labels.hpp"

#include <fmt/format.h>

#include <Eigen/LU>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <set>
#include <type_traits>
#include <unordered_map>
#include <utility>

namespace tunica {

/// Voxels of one value among up to 64 of a row.
template <typename T>
struct LabelIndex::Piece {
  T value;
  std::uint32_t at;  ///< word of the mask
  std::uint64_t bits;
};

namespace {

/// The pieces of up to 64 voxels, one for each value among them but 0, which is no label.
template <typename T, typename Piece>
void split_word(const T* values, std::size_t count, std::uint32_t at, std::vector<Piece>& pieces) {
  const std::uint64_t all = count == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
  bool differ = false;
  for (std::size_t i = 1; i < count; ++i) {
    differ |= values[i] != values[0];
  }
  if (!differ) {
    if (values[0] == values[0] && values[0] != T{0}) {
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
    if (bits != 0 && value != T{0}) {
      pieces.push_back({value, at, bits});
    }
  }
}

// What up to 64 values mean. Whole numbers without scaling are labels as they are stored.
template <typename Meaning, typename T>
const Meaning* labels_of(const T* values, std::size_t count, const Volume& slab, std::array<Meaning, 64>& labels) {
  if constexpr (std::is_integral_v<Meaning>) {
    return values;
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      // No rounding: a float's whole number is a float, and so is what label_meant() leaves alone.
      labels[i] = static_cast<Meaning>(label_meant(slab.slope * static_cast<double>(values[i]) + slab.intercept));
    }
    return labels.data();
  }
}

}  // namespace

LabelIndex::LabelIndex(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine,
                       std::size_t limit)
    : dims_(dims), affine_(affine), limit_(limit) {
  require_affine(affine);
  if (voxel_count(dims) > std::size_t{1} << 38 ||
      (dims[0] + 63) / 64 * dims[1] * dims[2] > std::numeric_limits<std::uint32_t>::max()) {
    throw InputError("the volume has more than 2^38 voxels, too many for all labels at once: name one label");
  }
}

void LabelIndex::add(const Volume& slab, std::size_t first_slice) {
  require_slab(slab, first_slice, dims_);
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if (slab.slope == 1 && slab.intercept == 0) {
          add_values<T>(slab, values, first_slice);
        } else {
          add_values<double>(slab, values, first_slice);
        }
      },
      slab.data);
}

template <typename Meaning, typename T>
void LabelIndex::add_values(const Volume& slab, const std::vector<T>& values, std::size_t first_slice) {
  // So few slices at a time that a grey volume, a piece for every voxel, is told before its pieces fill the memory.
  constexpr std::size_t most_voxels = std::size_t{1} << 22;
  const std::size_t words = (dims_[0] + 63) / 64;
  const std::size_t at_once = std::max<std::size_t>(1, most_voxels / (dims_[0] * dims_[1]));
  for (std::size_t first = 0; first < slab.dims[2] && !image_; first += at_once) {
    std::vector<std::vector<Piece<Meaning>>> slices(std::min(at_once, slab.dims[2] - first));
    parallel_for_blocks(slices.size(), 1, [&](std::size_t k, std::size_t) {
      check_interrupt();
      std::array<Meaning, 64> room;
      for (std::size_t j = 0; j < dims_[1]; ++j) {
        const T* const row = values.data() + dims_[0] * (j + dims_[1] * (first + k));
        const std::size_t first_word = words * (j + dims_[1] * (first_slice + first + k));
        for (std::size_t w = 0; w < words; ++w) {
          const std::size_t count = std::min<std::size_t>(64, dims_[0] - 64 * w);
          const Meaning* const labels = labels_of(row + 64 * w, count, slab, room);
          split_word(labels, count, narrow<std::uint32_t>(first_word + w), slices[k]);
        }
      }
    });
    for (const auto& slice : slices) {
      add_pieces(slice);
    }
  }
}

template <typename Meaning>
void LabelIndex::add_pieces(const std::vector<Piece<Meaning>>& pieces) {
  if (image_) {
    return;
  }
  const std::size_t words = (dims_[0] + 63) / 64;
  std::unordered_map<Meaning, Entry*> entry_of;
  for (const auto& [value, at, bits] : pieces) {
    const auto [found, fresh] = entry_of.try_emplace(value, nullptr);
    if (fresh) {
      const auto label = static_cast<double>(value);
      if (std::is_integral_v<Meaning> && static_cast<long double>(label) != static_cast<long double>(value)) {
        throw InputError(
            fmt::format("its label {} is above 2^53, where neighbouring labels become the same number: give the labels "
                        "smaller numbers",
                        value));
      }
      // Above 2^53 floating-point numbers are whole whatever they measure, and stand for their neighbours too.
      const bool measured = std::is_floating_point_v<Meaning> && std::abs(label) > 0x1p53;
      found->second = &entries_[label];
      if (measured || entries_.size() > limit_) {
        image_ = true;
        entries_.clear();
        return;
      }
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

std::optional<std::vector<Label>> LabelIndex::labels(const std::vector<std::pair<double, std::string>>& names) const {
  if (image_) {
    return std::nullopt;
  }
  const double voxel_volume = std::abs(affine_.leftCols<3>().determinant());
  std::map<double, std::set<std::string>> names_of;
  for (const auto& [value, name] : names) {
    names_of[value].insert(name);
  }
  constexpr std::size_t longest_name = 400;  // bytes: two of the longest that are read
  std::vector<Label> labels;
  for (const auto& [value, entry] : entries_) {
    std::string name;
    for (const std::string& one : names_of[value]) {
      name += name.empty() ? one : name.size() < longest_name ? " / " + one : "";
    }
    labels.push_back({value, entry.voxels, real(entry.voxels) * voxel_volume, std::move(name)});
  }
  return labels;
}

Mask LabelIndex::mask(double label) const {
  Mask mask(dims_, affine_);
  const Entry& entry = entry_of(label);
  std::uint64_t* const words = mask.row(0, 0);
  for (std::size_t i = 0; i < entry.at.size(); ++i) {
    words[entry.at[i]] |= entry.bits[i];
  }
  return mask;
}

MaskBounds LabelIndex::bounds(double label) const { return entry_of(label).bounds; }

const LabelIndex::Entry& LabelIndex::entry_of(double label) const {
  const auto found = entries_.find(label);
  if (found == entries_.end()) {
    throw InputError(fmt::format("no voxel has the label {}", label));
  }
  return found->second;
}

std::size_t LabelIndex::surface_vertices(double label) const {
  const Entry& entry = entry_of(label);
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
