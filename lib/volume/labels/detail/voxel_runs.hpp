#pragma once

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <algorithm>
#include <bit>
#include <vector>

namespace tunica {

/// Maximal runs of equal voxels along i, row after row, joined to components.
/// Source: union-find over runs (He, Chao, Suzuki 2008). Cost: one pass over the bits, 16 bytes per run.
class VoxelRuns {
public:
  struct Run {
    std::size_t begin;
    std::size_t end;  ///< one past the last voxel
  };

  VoxelRuns(const Mask& mask, bool inside) : mask_(mask) {
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

  /// Voxels of each component, at its root; 0 elsewhere.
  std::vector<std::size_t> component_sizes() {
    std::vector<std::size_t> sizes(runs_.size(), 0);
    for (std::size_t run = 0; run < runs_.size(); ++run) {
      sizes[root(run)] += runs_[run].end - runs_[run].begin;
    }
    return sizes;
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

/// Puts the voxels of a run of row j, slice k in or out.
inline void set_run(Mask& mask, const VoxelRuns::Run& run, std::size_t j, std::size_t k, bool inside) {
  for (std::size_t i = run.begin; i < run.end; ++i) {
    mask.set(i, j, k, inside);
  }
}

}  // namespace tunica
