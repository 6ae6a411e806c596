#include "volume/labels.hpp"

#include "core/progress.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>
#include <type_traits>
#include <unordered_map>

namespace tunica {
namespace {

/// Counts equal stored values. @return false when there are more than `limit` different ones
template <typename T>
bool count_values(const std::vector<T>& values, std::size_t limit, std::unordered_map<T, std::size_t>& counts) {
  constexpr std::size_t between_checks = std::size_t{1} << 24;
  for (std::size_t i = 0; i < values.size();) {
    if (i % between_checks == 0) {
      check_interrupt();
    }
    const T value = values[i];
    if (value != value) {
      ++i;
      continue;
    }
    // Segmentations are made of runs; the look-up is paid once per run.
    const std::size_t stop = std::min(values.size(), (i / between_checks + 1) * between_checks);
    std::size_t end = i + 1;
    while (end < stop && values[end] == value) {
      ++end;
    }
    counts[value] += end - i;
    if (counts.size() > limit) {
      return false;
    }
    i = end;
  }
  return true;
}

}  // namespace

std::optional<std::vector<Label>> list_labels(const Volume& volume, std::size_t limit) {
  // Different stored values may mean the same.
  std::map<double, std::size_t> meanings;
  const bool few = std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        std::unordered_map<T, std::size_t> counts;
        if (!count_values(values, limit + 1, counts)) {
          return false;
        }
        for (const auto& [value, count] : counts) {
          const double meaning = volume.slope * static_cast<double>(value) + volume.intercept;
          if (meaning != 0 && !std::isnan(meaning)) {
            meanings[meaning] += count;
          }
        }
        return meanings.size() <= limit;
      },
      volume.data);
  if (!few) {
    return std::nullopt;
  }
  const double voxel_volume = std::abs(volume.affine.leftCols<3>().determinant());
  std::vector<Label> labels;
  for (const auto& [value, count] : meanings) {
    const auto name = std::ranges::find(volume.label_names, value, [](const auto& entry) { return entry.first; });
    labels.push_back({value, count, static_cast<double>(count) * voxel_volume,
                      name == volume.label_names.end() ? std::string{} : name->second});
  }
  return labels;
}

}  // namespace tunica
