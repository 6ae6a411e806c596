#include "tunica/volume/labels/components.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/volume/labels/detail/voxel_runs.hpp"

#include <algorithm>
#include <functional>

namespace tunica {
std::vector<std::size_t> piece_sizes(const Mask& mask) {
  VoxelRuns runs(mask, true);
  runs.connect(false);
  std::vector<std::size_t> sizes = runs.component_sizes();
  std::erase(sizes, 0U);
  std::ranges::sort(sizes, std::greater{});
  return sizes;
}

std::size_t keep_largest_piece(Mask& mask) {
  VoxelRuns runs(mask, true);
  runs.connect(false);
  const std::vector<std::size_t> sizes = runs.component_sizes();
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
  VoxelRuns runs(mask, false);
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
