#include "tunica/volume/labels/shelter.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/volume/labels/detail/voxel_runs.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>
#include <vector>

namespace tunica {
namespace {

using Words = std::vector<std::uint64_t>;

/// Of 26: more than two thirds.
constexpr unsigned least_directions = 18;
constexpr std::size_t counter_bits = 5;
/// A counter that begins here runs over when it has counted that many.
constexpr unsigned counter_start = (1U << counter_bits) - least_directions;

struct Box {
  std::array<std::size_t, 3> first{};  ///< along i in words
  std::array<std::size_t, 3> size{};   ///< along i in words
};

/// Of the selection and one voxel around it as far as there is one: from its border on, lines meet nothing more.
Box box_of(const Mask& mask) {
  const auto [columns, rows, slices] = mask.dims();
  std::array<std::size_t, 3> low = mask.dims();
  std::array<std::size_t, 3> high{};
  const auto widen = [&](const std::array<std::size_t, 3>& at) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], at[axis]);
      high[axis] = std::max(high[axis], at[axis]);
    }
  };
  for (std::size_t row = 0; row < rows * slices; ++row) {
    const std::uint64_t* const words = mask.row(row % rows, row / rows);
    for (std::size_t w = 0; w < mask.words_per_row(); ++w) {
      if (words[w] != 0) {
        widen({64 * w + narrow<std::size_t>(std::countr_zero(words[w])), row % rows, row / rows});
        widen({64 * w + 63 - narrow<std::size_t>(std::countl_zero(words[w])), row % rows, row / rows});
      }
    }
  }
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t unit = axis == 0 ? 64 : 1;
    box.first[axis] = (low[axis] - std::min<std::size_t>(low[axis], 1)) / unit;
    box.size[axis] = std::min(high[axis] + 1, mask.dims()[axis] - 1) / unit + 1 - box.first[axis];
  }
  return box;
}

Mask cropped(const Mask& mask, const Box& box) {
  Eigen::Matrix<double, 3, 4> affine = mask.affine();
  affine.col(3) += affine.leftCols<3>() * Vec3(real(64 * box.first[0]), real(box.first[1]), real(box.first[2]));
  const std::size_t columns = std::min(64 * box.size[0], mask.dims()[0] - 64 * box.first[0]);
  Mask part({columns, box.size[1], box.size[2]}, affine);
  for (std::size_t k = 0; k < box.size[2]; ++k) {
    for (std::size_t j = 0; j < box.size[1]; ++j) {
      std::copy_n(mask.row(j + box.first[1], k + box.first[2]) + box.first[0], box.size[0], part.row(j, k));
    }
  }
  return part;
}

/// Sweeps over the slices, for each of the 26 directions (a, b, c) in voxels. Nine words of bits per word of a slice
/// say for its voxels whether the lines (a, b), all with the same c, meet the selection; those of (0, 0, 0) meet
/// nothing.
class Sweep {
public:
  explicit Sweep(const Mask& mask)
      : mask_(mask),
        words_(mask.words_per_row()),
        plane_(words_ * mask.dims()[1]),
        sheltered_(mask.dims(), mask.affine()) {
    for (std::size_t bit = 0; bit < counter_bits; ++bit) {
      counters_[bit].assign(plane_ * mask.dims()[2], (counter_start >> bit & 1) != 0 ? all : 0);
    }
  }

  /// The voxels outside that are sheltered.
  Mask run() {
    const std::size_t slices = mask_.dims()[2];
    Words flat(9 * plane_);
    Words lines;
    Words beyond;
    for (std::size_t k = 0; k < slices; ++k) {
      check_interrupt();
      stay(flat, k);
      add(flat, k);
      pass(lines, k, k > 0 ? &beyond : nullptr, flat, k - 1);
      std::swap(lines, beyond);
    }
    for (std::size_t k = slices; k-- > 0;) {
      check_interrupt();
      pass(lines, k, k + 1 < slices ? &beyond : nullptr, flat, k + 1);
      std::swap(lines, beyond);
    }
    const std::uint64_t* const selected = mask_.row(0, 0);
    std::uint64_t* const outside = sheltered_.row(0, 0);
    for (std::size_t w = 0; w < plane_ * slices; ++w) {
      outside[w] &= ~selected[w];
    }
    return std::move(sheltered_);
  }

private:
  static constexpr std::uint64_t all = ~std::uint64_t{0};

  /// Lines that stay in slice k.
  void stay(Words& lines, std::size_t k) const {
    const std::size_t rows = mask_.dims()[1];
    for (std::size_t j = 0; j < rows; ++j) {
      fill_row(mask_.row(j, k), row(lines, 1, 0, j), row(lines, -1, 0, j));
    }
    for (const int b : {-1, 1}) {
      for (const int a : {0, -1, 1}) {
        for (std::size_t n = 0; n < rows; ++n) {
          step(lines, lines, a, b, {b > 0 ? rows - 1 - n : n, k, k});
        }
      }
    }
  }

  /// Lines from slice k to `next`, whose lines are `beyond`; at the image's border those that stay. Counts them.
  void pass(Words& lines, std::size_t k, Words* beyond, const Words& flat, std::size_t next) {
    if (beyond == nullptr) {
      lines = flat;
    } else {
      lines.resize(flat.size());
      for (const int b : {0, -1, 1}) {
        for (const int a : {0, -1, 1}) {
          for (std::size_t j = 0; j < mask_.dims()[1]; ++j) {
            step(lines, *beyond, a, b, {j, k, next});
          }
        }
      }
    }
    add(lines, k);
  }

  [[nodiscard]] std::uint64_t* row(Words& lines, int a, int b, std::size_t j) const {
    return lines.data() + narrow<std::size_t>(a + 1 + 3 * (b + 1)) * plane_ + j * words_;
  }
  [[nodiscard]] std::uint64_t last_bits() const {
    const std::size_t rest = mask_.dims()[0] % 64;
    return rest == 0 ? all : (std::uint64_t{1} << rest) - 1;
  }

  /// What has a voxel of the selection after it in its row, and what has one before it.
  void fill_row(const std::uint64_t* selected, std::uint64_t* after, std::uint64_t* before) const {
    bool met = false;
    for (std::size_t w = words_; w-- > 0;) {
      const std::uint64_t below = selected[w] != 0 ? std::bit_floor(selected[w]) - 1 : 0;
      after[w] = met ? all : below;
      met = met || selected[w] != 0;
    }
    met = false;
    for (std::size_t w = 0; w < words_; ++w) {
      const std::uint64_t lowest = selected[w] & (0 - selected[w]);
      before[w] = met ? all : ~((lowest << 1) - 1);
      met = met || selected[w] != 0;
    }
    after[words_ - 1] &= last_bits();
    before[words_ - 1] &= last_bits();
  }

  struct Place {
    std::size_t j;
    std::size_t k;
    std::size_t next;  ///< slice
  };

  /// A row of the lines (a, b): they meet what is selected on the way to the next voxel, first along i, then j, then k,
  /// or what the line there, in `beyond`, meets. At the image's border the step across it is left out.
  void step(Words& lines, Words& beyond, int a, int b, const Place& at) const {
    std::uint64_t* const to = row(lines, a, b, at.j);
    if ((b < 0 && at.j == 0) || (b > 0 && at.j + 1 == mask_.dims()[1])) {
      std::copy_n(row(lines, a, 0, at.j), words_, to);
      return;
    }
    const std::size_t there = b < 0 ? at.j - 1 : b > 0 ? at.j + 1 : at.j;
    const std::uint64_t* const here = mask_.row(at.j, at.k);
    const std::uint64_t* const beside = mask_.row(there, at.k);
    const std::uint64_t* const selected = mask_.row(there, at.next);
    const std::uint64_t* const line = row(beyond, a, b, there);
    const auto met = [&](std::size_t w) {
      return (a != 0 ? here[w] : 0) | (b != 0 ? beside[w] : 0) | selected[w] | line[w];
    };
    for (std::size_t w = 0; w < words_; ++w) {
      if (a == 0) {
        to[w] = met(w);
      } else if (a > 0) {
        to[w] = met(w) >> 1 | (w + 1 < words_ ? met(w + 1) << 63 : 0);
      } else {
        to[w] = met(w) << 1 | (w > 0 ? met(w - 1) >> 63 : 0);
      }
    }
    to[words_ - 1] &= last_bits();
    if (a != 0) {
      const std::size_t border = a > 0 ? mask_.dims()[0] - 1 : 0;
      const std::uint64_t bit = std::uint64_t{1} << border % 64;
      to[border / 64] = (to[border / 64] & ~bit) | (row(lines, 0, b, at.j)[border / 64] & bit);
    }
  }

  void add(const Words& lines, std::size_t k) {
    std::uint64_t* const over = sheltered_.row(0, k);
    for (std::size_t direction = 0; direction < 9; ++direction) {
      for (std::size_t w = 0; w < plane_; ++w) {
        std::uint64_t carry = lines[direction * plane_ + w];
        for (Words& counter : counters_) {
          carry &= std::exchange(counter[k * plane_ + w], counter[k * plane_ + w] ^ carry);
        }
        over[w] |= carry;
      }
    }
  }

  const Mask& mask_;
  std::size_t words_;
  std::size_t plane_;  ///< words of a slice
  Mask sheltered_;
  std::array<Words, counter_bits> counters_;
};

}  // namespace

Shelter find_shelter(const Mask& mask) {
  const std::size_t selected = count_voxels(mask);
  if (selected == 0) {
    return {};
  }
  const Mask box = cropped(mask, box_of(mask));
  const Mask sheltered = Sweep(box).run();
  VoxelRuns runs(sheltered, true);
  runs.connect(false);
  const std::vector<std::size_t> sizes = runs.component_sizes();
  const auto largest = std::ranges::max_element(sizes);
  if (largest == sizes.end()) {
    return {};
  }
  const auto root = narrow<std::size_t>(largest - sizes.begin());
  Vec3 sum = Vec3::Zero();
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    if (runs.root(run) == root) {
      const auto [begin, end] = runs[run];
      sum += real(end - begin) * Vec3(0.5 * real(begin + end - 1), real(j), real(k));
    }
  });
  return {real(*largest) / real(*largest + selected),
          box.affine().leftCols<3>() * (sum / real(*largest)) + box.affine().col(3)};
}

}  // namespace tunica
