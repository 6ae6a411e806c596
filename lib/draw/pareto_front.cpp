#include "tunica/draw/chart.hpp"

#include "tunica/core/error.hpp"
#include "tunica/draw/detail/chart_legend.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunica {

std::vector<std::vector<bool>> pareto_front(const Chart& chart) {
  struct Entry {
    double x, y;
    std::size_t series, mark;
  };
  std::vector<Entry> entries;
  std::vector<std::vector<bool>> front;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    front.emplace_back(chart.series[s].marks.size(), false);
    for (std::size_t m = 0; m < chart.series[s].marks.size(); ++m) {
      const ChartMark& mark = chart.series[s].marks[m];
      if (!std::isfinite(mark.x) || !std::isfinite(mark.y)) {
        throw InputError(fmt::format("{}: a mark of the chart is not at a finite place", mark.name));
      }
      entries.push_back({chart.x.more_is_better ? -mark.x : mark.x, chart.y.more_is_better ? -mark.y : mark.y, s, m});
    }
  }
  if (!has_front(chart)) {
    return front;
  }
  std::ranges::sort(entries, [](const Entry& a, const Entry& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  double best = std::numeric_limits<double>::infinity();
  double best_x = 0;
  for (const Entry& entry : entries) {
    // Two runs with the same pair of values are both on the front.
    if (entry.y < best || (entry.y == best && entry.x == best_x)) {
      front[entry.series][entry.mark] = true;
      best = entry.y;
      best_x = entry.x;
    }
  }
  return front;
}

}  // namespace tunica
