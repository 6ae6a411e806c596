#include "tunica/volume/labels/components.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"

#include <algorithm>
#include <bit>
#include <functional>

namespace tunica {
namespace {

/// Maximal runs of equal voxels along i, row after row, joined to components.
class Runs {
public:
  struct Run {
    std::size_t begin;
    std::size_t end;  ///< one past the last voxel
  };

  Runs(const Mask& mask, bool inside) : mask_(mask) {
    const auto [columns, rows, slices] = mask.dims();
    first_.reserve(rows * slices + 1);
    first_.push_back(0);
    for (std::size_t k = 0; k < slices; ++k) {
      check_interrupt();
      for (std::size_t j = 0; j < rows; ++j) {
        const std::uint64_t* const words = mask.row(j, k);
        for (std::size_t at = next_bit(words, 0, columns, inside); at < columns;) {
          const std::size_t end = next_bit(words, at, columns, !inside);
          runs_.push_back({at, end});
          at = next_bit(words, end, columns, inside);
        }
        first_.push_back(runs_.size());
      }
    }
    joined_ = DisjointSets<std::size_t>(runs_.size());
  }

  /// Joins runs of neighbouring rows that share a face, or with `edges` also those that share an edge only.
  void connect(bool edges) {
    const auto [columns, rows, slices] = mask_.dims();
    for (std::size_t k = 0; k < slices; ++k) {
      check_interrupt();
      for (std::size_t j = 0; j < rows; ++j) {
        const std::size_t row = j + rows * k;
        const std::size_t reach = edges ? 1 : 0;
        if (j > 0) {
          connect_rows(row, row - 1, reach);
        }
        if (k > 0) {
          connect_rows(row, row - rows, reach);
          if (edges && j > 0) {
            connect_rows(row, row - rows - 1, 0);
          }
          if (edges && j + 1 < rows) {
            connect_rows(row, row - rows + 1, 0);
          }
        }
      }
    }
  }

  [[nodiscard]] std::size_t size() const { return runs_.size(); }
  [[nodiscard]] const Run& operator[](std::size_t run) const { return runs_[run]; }

  /// The first run of a run's component.
  std::size_t root(std::size_t run) { return joined_.root(run); }

  /// Calls visit(run, j, k) in order.
  template <typename Visit>
  void for_each(const Visit& visit) const {
    const std::size_t rows = mask_.dims()[1];
    for (std::size_t row = 0; row + 1 < first_.size(); ++row) {
      for (std::size_t run = first_[row]; run < first_[row + 1]; ++run) {
        visit(run, row % rows, row / rows);
      }
    }
  }

private:
  /// First place from `from` on whose bit is `value`; `end` when there is none before it.
  static std::size_t next_bit(const std::uint64_t* words, std::size_t from, std::size_t end, bool value) {
    while (from < end) {
      const std::uint64_t word = (value ? words[from / 64] : ~words[from / 64]) >> (from % 64);
      if (word != 0) {
        return std::min(end, from + std::countr_zero(word));
      }
      from = (from / 64 + 1) * 64;
    }
    return end;
  }

  void connect_rows(std::size_t row, std::size_t other, std::size_t reach) {
    std::size_t a = first_[row];
    std::size_t b = first_[other];
    while (a < first_[row + 1] && b < first_[other + 1]) {
      if (runs_[a].begin < runs_[b].end + reach && runs_[b].begin < runs_[a].end + reach) {
        joined_.join(a, b);
      }
      ++(runs_[a].end < runs_[b].end ? a : b);
    }
  }

  const Mask& mask_;
  std::vector<Run> runs_;
  std::vector<std::size_t> first_;  ///< first run of each row, and one more
  DisjointSets<std::size_t> joined_{0};
};

/// Voxels of each component, at its root.
std::vector<std::size_t> component_sizes(Runs& runs) {
  std::vector<std::size_t> sizes(runs.size(), 0);
  for (std::size_t run = 0; run < runs.size(); ++run) {
    sizes[runs.root(run)] += runs[run].end - runs[run].begin;
  }
  return sizes;
}

void set_run(Mask& mask, const Runs::Run& run, std::size_t j, std::size_t k, bool inside) {
  for (std::size_t i = run.begin; i < run.end; ++i) {
    mask.set(i, j, k, inside);
  }
}

}  // namespace

std::vector<std::size_t> piece_sizes(const Mask& mask) {
  Runs runs(mask, true);
  runs.connect(false);
  std::vector<std::size_t> sizes = component_sizes(runs);
  std::erase(sizes, 0U);
  std::ranges::sort(sizes, std::greater{});
  return sizes;
}

std::size_t keep_largest_piece(Mask& mask) {
  Runs runs(mask, true);
  runs.connect(false);
  const std::vector<std::size_t> sizes = component_sizes(runs);
  if (sizes.empty()) {
    return 0;
  }
  const std::size_t largest = std::ranges::max_element(sizes) - sizes.begin();
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    if (runs.root(run) != largest) {
      set_run(mask, runs[run], j, k, false);
    }
  });
  return narrow<std::size_t>(std::ranges::count_if(sizes, [](std::size_t size) { return size > 0; })) - 1;
}

std::size_t fill_cavities(Mask& mask) {
  Runs runs(mask, false);
  runs.connect(true);
  const auto [columns, rows, slices] = mask.dims();
  std::vector<bool> outside(runs.size(), false);
  runs.for_each([&, columns = columns, rows = rows, slices = slices](std::size_t run, std::size_t j, std::size_t k) {
    const bool at_border =
        runs[run].begin == 0 || runs[run].end == columns || j == 0 || j + 1 == rows || k == 0 || k + 1 == slices;
    if (at_border) {
      outside[runs.root(run)] = true;
    }
  });
  std::size_t cavities = 0;
  runs.for_each([&](std::size_t run, std::size_t j, std::size_t k) {
    const std::size_t root = runs.root(run);
    if (!outside[root]) {
      cavities += root == run;
      set_run(mask, runs[run], j, k, true);
    }
  });
  return cavities;
}

}  // namespace tunica
