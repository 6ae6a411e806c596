#include "tunica/volume/labels/mask.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/volume/labels/pack_bits.hpp"
#include "tunica/volume/labels/whole_labels.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <type_traits>

namespace tunica {
namespace {

/// A value's place in the order of its type, and back: so that one bisection serves all types.
template <typename T>
struct Order {
  using Key =
      std::conditional_t<std::is_floating_point_v<T>, std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>,
                         std::make_unsigned_t<std::conditional_t<std::is_floating_point_v<T>, std::int32_t, T>>>;
  static constexpr Key sign = Key{1} << (sizeof(Key) * 8 - 1);

  static T value(Key key) {
    if constexpr (std::is_floating_point_v<T>) {
      return std::bit_cast<T>((key & sign) != 0 ? static_cast<Key>(key & ~sign) : static_cast<Key>(~key));
    } else if constexpr (std::is_signed_v<T>) {
      return static_cast<T>(static_cast<Key>(key ^ sign));
    } else {
      return key;
    }
  }
  static Key key(T v) {
    if constexpr (std::is_floating_point_v<T>) {
      const Key bits = std::bit_cast<Key>(v);
      return (bits & sign) != 0 ? static_cast<Key>(~bits) : static_cast<Key>(bits | sign);
    } else if constexpr (std::is_signed_v<T>) {
      return static_cast<Key>(static_cast<Key>(v) ^ sign);
    } else {
      return v;
    }
  }
  static T lowest() {
    return std::is_floating_point_v<T> ? -std::numeric_limits<T>::infinity() : std::numeric_limits<T>::lowest();
  }
  static T highest() {
    return std::is_floating_point_v<T> ? std::numeric_limits<T>::infinity() : std::numeric_limits<T>::max();
  }
};

/// The stored values that are inside: they are neighbours in their type's order, for slope * v + intercept is monotone
/// in floating point too, and so is label_meant().
template <typename T>
struct Range {
  T first;
  T last;
};

template <typename T>
std::optional<Range<T>> stored_range(const Volume& volume, const Inside& rule) {
  const bool scaled = volume.slope != 1 || volume.intercept != 0;
  const bool rounded = rule.rule == Inside::Rule::label && (scaled || std::is_floating_point_v<T>);
  // long double holds every 64-bit integer.
  const auto meaning = [&](T v) -> long double {
    if (!scaled && !rounded) {
      return static_cast<long double>(v);
    }
    const double value = volume.slope * static_cast<double>(v) + volume.intercept;
    return static_cast<long double>(rounded ? label_meant(value) : value);
  };
  const auto threshold = static_cast<long double>(rule.value);
  const auto above = [&](T v) { return meaning(v) > threshold; };
  const auto below = [&](T v) { return meaning(v) < threshold; };
  // First value in the order at which `test`, false and then true, becomes true.
  using Key = typename Order<T>::Key;
  const auto first_true = [](auto test) -> std::optional<Key> {
    Key low = Order<T>::key(Order<T>::lowest());
    Key high = Order<T>::key(Order<T>::highest());
    if (!test(Order<T>::value(high))) {
      return std::nullopt;
    }
    while (low < high) {
      const auto middle = static_cast<Key>(low + (high - low) / 2);
      if (test(Order<T>::value(middle))) {
        high = middle;
      } else {
        low = static_cast<Key>(middle + 1);
      }
    }
    return low;
  };
  const bool rising = volume.slope > 0;
  // In stored order: values before `begin` are too small, values from `end` on too large.
  const auto small = [&](T v) { return rising ? below(v) : above(v); };
  const auto large = [&](T v) { return rising ? above(v) : below(v); };
  const std::optional<Key> end_of_small = first_true([&](T v) { return !small(v); });
  const std::optional<Key> start_of_large = first_true([&](T v) { return large(v); });
  const Key lowest = Order<T>::key(Order<T>::lowest());
  const Key highest = Order<T>::key(Order<T>::highest());
  const auto range = [](Key first, Key last) { return Range<T>{Order<T>::value(first), Order<T>::value(last)}; };
  const bool want_large = (rule.rule == Inside::Rule::above) == rising;
  if (rule.rule == Inside::Rule::label) {
    if (!end_of_small || (start_of_large && *start_of_large <= *end_of_small)) {
      return std::nullopt;
    }
    return range(*end_of_small, start_of_large ? static_cast<Key>(*start_of_large - 1) : highest);
  }
  if (want_large) {
    return start_of_large ? std::optional(range(*start_of_large, highest)) : std::nullopt;
  }
  if (!end_of_small) {
    return range(lowest, highest);
  }
  return *end_of_small > lowest ? std::optional(range(lowest, static_cast<Key>(*end_of_small - 1))) : std::nullopt;
}

template <typename T>
void select_row(const T* values, std::size_t count, const Range<T>& range, std::uint64_t* words) {
  std::size_t i = 0;
  for (; i + 64 <= count; i += 64) {
    words[i / 64] = bits_in_range(values + i, range.first, range.last);
  }
  if (i < count) {
    std::uint64_t word = 0;
    for (std::size_t bit = 0; i + bit < count; ++bit) {
      const T value = values[i + bit];
      word |= std::uint64_t(value >= range.first && value <= range.last) << bit;
    }
    words[i / 64] = word;
  }
}

std::size_t word_count(const Mask& mask) { return mask.words_per_row() * mask.dims()[1] * mask.dims()[2]; }

std::size_t count_bits(const std::uint64_t* words, std::size_t count) {
  return std::transform_reduce(words, words + count, std::size_t{0}, std::plus{},
                               [](std::uint64_t word) { return std::popcount(word); });
}

}  // namespace

Mask::Mask(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine)
    : dims_(dims), words_per_row_((dims[0] + 63) / 64), affine_(affine) {
  // A row of one voxel takes a word.
  voxel_count({words_per_row_ * 64, dims[1], dims[2]});
  require_affine(affine);
  words_ = decltype(words_)(words_per_row_ * dims[1] * dims[2]);
}

double Mask::voxel_volume() const { return std::abs(affine_.leftCols<3>().determinant()); }

void select(const Volume& slab, std::size_t first_slice, const Inside& rule, Mask& mask) {
  require_slab(slab, first_slice, mask.dims());
  if (std::isnan(rule.value)) {
    throw InputError("not-a-number is neither a label nor an isovalue");
  }
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        const std::optional<Range<T>> range = stored_range<T>(slab, rule);
        if (!range) {
          return;
        }
        parallel_for_blocks(slab.dims[2], 4, [&](std::size_t begin, std::size_t end) {
          check_interrupt();
          for (std::size_t row = begin * slab.dims[1]; row < end * slab.dims[1]; ++row) {
            select_row(values.data() + row * slab.dims[0], slab.dims[0], *range, mask.row(row, first_slice));
          }
        });
      },
      slab.data);
}

Mask select(const Volume& volume, const Inside& rule) {
  Mask mask(volume.dims, volume.affine);
  select(volume, 0, rule, mask);
  return mask;
}

std::size_t count_not_finite(const Volume& volume) {
  return std::visit(
      [](const auto& values) -> std::size_t {
        using T = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_floating_point_v<T>) {
          constexpr std::size_t block = 1 << 16;
          std::atomic<std::size_t> count = 0;
          parallel_for_blocks(values.size(), block, [&](std::size_t begin, std::size_t end) {
            check_interrupt();
            std::size_t here = 0;
            for (std::size_t i = begin; i < end; ++i) {
              here += std::isfinite(values[i]) ? 0 : 1;
            }
            count += here;
          });
          return count;
        } else {
          return 0;
        }
      },
      volume.data);
}

std::size_t count_voxels(const Mask& mask) { return count_bits(mask.row(0, 0), word_count(mask)); }

std::size_t count_at_border(const Mask& mask) {
  const auto [width, height, depth] = mask.dims();
  const auto is_end = [](std::size_t at, std::size_t size) { return size > 1 && (at == 0 || at + 1 == size); };
  std::size_t count = 0;
  for (std::size_t k = 0; k < depth; ++k) {
    for (std::size_t j = 0; j < height; ++j) {
      if (is_end(k, depth) || is_end(j, height)) {
        count += count_bits(mask.row(j, k), mask.words_per_row());
      } else if (width > 1) {
        count += std::size_t{mask(0, j, k)} + std::size_t{mask(width - 1, j, k)};
      }
    }
  }
  return count;
}

void unite(Mask& mask, const Mask& other) {
  if (mask.dims() != other.dims()) {
    throw InputError("selections of different dimensions cannot be united");
  }
  std::transform(mask.row(0, 0), mask.row(0, 0) + word_count(mask), other.row(0, 0), mask.row(0, 0), std::bit_or{});
}

void drop_beyond(Mask& mask, const Vec3& normal, double offset) {
  const auto [width, height, depth] = mask.dims();
  const double step = normal.dot(mask.affine().col(0));
  for (std::size_t k = 0; k < depth; ++k) {
    for (std::size_t j = 0; j < height; ++j) {
      const double first = normal.dot(mask.affine() * Eigen::Vector4d(0, real(j), real(k), 1));
      for (std::size_t i = 0; i < width; ++i) {
        if (first + step * real(i) > offset && mask(i, j, k)) {
          mask.set(i, j, k, false);
        }
      }
    }
  }
}

std::size_t count_differing(const Mask& a, const Mask& b) {
  if (a.dims() != b.dims()) {
    throw InputError("selections of different dimensions cannot be compared");
  }
  return std::transform_reduce(a.row(0, 0), a.row(0, 0) + word_count(a), b.row(0, 0), std::size_t{0}, std::plus{},
                               [](std::uint64_t l, std::uint64_t r) { return std::popcount(l ^ r); });
}

}  // namespace tunica
