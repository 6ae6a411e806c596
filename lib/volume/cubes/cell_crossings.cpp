#include "tunica/volume/cubes/cell_crossings.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t words_per_block = 4096;
/// A cell's number counts x first, then y, then z, in steps that leave room for every volume that can be indexed.
constexpr std::uint64_t step_y = std::uint64_t{1} << 21, step_z = step_y << 21;

struct Bounds {
  Vec3 lower, upper;
  [[nodiscard]] bool meet(const Bounds& o) const {
    return (lower.array() <= o.upper.array()).all() && (o.lower.array() <= upper.array()).all();
  }
};

bool cross(const std::array<Index, 3>& one, const std::array<Index, 3>& other, const std::vector<Vec3>& places) {
  std::size_t shared = 0, k = 0, l = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      if (one[i] == other[j]) {
        ++shared;
        k = i;
        l = j;
      }
    }
  }
  if (shared > 1) {
    return false;
  }
  const auto from = [&](const std::array<Index, 3>& t, std::size_t first) {
    return std::array<Vec3, 3>{places[t[first]], places[t[(first + 1) % 3]], places[t[(first + 2) % 3]]};
  };
  return shared == 1 ? triangles_cross_beside_corner(from(one, k), from(other, l))
                     : triangles_cross(from(one, 0), from(other, 0));
}

}  // namespace

CellCrossings::CellCrossings(const std::vector<std::array<Index, 3>>& triangles, const std::vector<Vec3>& start)
    : triangles_(triangles), cell_(triangles.size()), in_cell_(triangles.size()) {
  std::vector<std::uint64_t> cell(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    const Vec3 middle = (start[a] + start[b] + start[c]) / 3;
    // No cell is below -1, so that these are 1 or more and their neighbours none below 0.
    const auto at = [&](int axis) { return truncated<std::uint64_t>(std::floor(middle[axis]) + 2); };
    cell[t] = at(0) + step_y * at(1) + step_z * at(2);
  }
  std::iota(in_cell_.begin(), in_cell_.end(), Index{0});
  std::sort(in_cell_.begin(), in_cell_.end(),
            [&](Index l, Index r) { return cell[l] < cell[r] || (cell[l] == cell[r] && l < r); });
  std::transform(in_cell_.begin(), in_cell_.end(), cell_.begin(), [&](Index t) { return cell[t]; });
}

std::vector<std::array<Index, 2>> CellCrossings::find(const std::vector<Vec3>& places) const {
  const std::size_t size = cell_.size();
  std::vector<Bounds> bounds(size);
  parallel_for_blocks(size, words_per_block, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [a, b, c] = triangles_[in_cell_[i]];
      bounds[i] = {places[a].cwiseMin(places[b]).cwiseMin(places[c]),
                   places[a].cwiseMax(places[b]).cwiseMax(places[c])};
    }
  });
  // Of the rows of three cells around a triangle's own, those after it; the first begins at the triangle itself.
  constexpr std::array<std::uint64_t, 5> rows{0, step_y, step_z - step_y, step_z, step_z + step_y};
  std::vector<std::vector<std::array<Index, 2>>> found((size + words_per_block - 1) / words_per_block);
  parallel_for_blocks(size, words_per_block, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    std::array<std::size_t, rows.size()> first;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      first[r] =
          narrow<std::size_t>(std::lower_bound(cell_.begin(), cell_.end(), cell_[begin] + rows[r] - 1) - cell_.begin());
    }
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t r = 0; r < rows.size(); ++r) {
        const std::uint64_t middle = cell_[i] + rows[r];
        while (first[r] < size && cell_[first[r]] + 1 < middle) {
          ++first[r];
        }
        for (std::size_t j = r == 0 ? i + 1 : first[r]; j < size && cell_[j] <= middle + 1; ++j) {
          if (bounds[i].meet(bounds[j]) && cross(triangles_[in_cell_[i]], triangles_[in_cell_[j]], places)) {
            found[begin / words_per_block].push_back(
                {std::min(in_cell_[i], in_cell_[j]), std::max(in_cell_[i], in_cell_[j])});
          }
        }
      }
    }
  });
  std::vector<std::array<Index, 2>> all;
  for (const auto& part : found) {
    all.insert(all.end(), part.begin(), part.end());
  }
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace tunica
