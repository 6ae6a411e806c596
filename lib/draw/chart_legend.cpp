#include "tunica/draw/detail/chart_legend.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/chart_style.hpp"
#include "tunica/draw/detail/svg_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace tunica {
namespace {

constexpr std::size_t most_names = 40;
constexpr double row_height = 24;
constexpr double text_left = 42;  // of the entry

struct LegendEntry {
  std::string line;  ///< style of a line, empty: none
  std::optional<std::size_t> series;
  std::string mark;  ///< how that of the series is filled
  std::string name;
  std::vector<std::string> text = {};
};

std::vector<LegendEntry> legend_entries(const Chart& chart) {
  std::vector<LegendEntry> entries;
  std::vector<std::size_t> named;
  bool any = false;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    any = any || !chart.series[s].marks.empty();
    if (!chart.series[s].name.empty()) {
      named.push_back(s);
    }
  }
  const std::size_t shown = named.size() > most_names ? most_names - 1 : named.size();
  for (std::size_t i = 0; i < shown; ++i) {
    const std::size_t s = named[i];
    entries.push_back({chart.series[s].joined ? series_line(s) : "", s, full_mark(s), chart.series[s].name});
  }
  if (shown < named.size()) {
    entries.push_back({"", {}, "", fmt::format("… and {} more", named.size() - shown)});
  }
  if (any && has_front(chart)) {
    entries.push_back({front_line(), {}, "", "Pareto front: no run is better in both"});
  }
  if (chart.guide) {
    entries.push_back({guide_line(), {}, "", chart.guide->label});
  }
  if (has_failures(chart)) {
    entries.push_back({"", 0, hollow_mark(Ink::frame), "hollow, on the rim: failed"});
  }
  for (LegendEntry& entry : entries) {
    entry.text = wrapped(entry.name, chart_width - 70, tick_size);
    entry.text.resize(std::max<std::size_t>(entry.text.size(), 1));
  }
  return entries;
}

// The way in which a chart with a front gets better.
std::string better(const Chart& chart) {
  return fmt::format("{} {} is better", chart.y.more_is_better ? "Upper" : "Lower",
                     chart.x.more_is_better ? "right" : "left");
}

std::string drawn(const LegendEntry& entry, double left, double base) {
  const double middle = base - 0.36 * tick_size;
  std::string svg;
  if (!entry.line.empty()) {
    svg += line_element(left, middle, left + 32, middle, entry.line);
  }
  if (entry.series) {
    svg += mark_shape({left + 16, middle}, *entry.series) + " " + entry.mark + "/>\n";
  }
  for (std::size_t i = 0; i < entry.text.size(); ++i) {
    svg += text_element(left + text_left, base + (row_height - 4) * real(i), entry.text[i], tick_size,
                        fill(Ink::soft_text));
  }
  return svg;
}

}  // namespace

Legend chart_legend(const Chart& chart, double top) {
  Legend legend;
  double y = top;
  std::string head = chart.series_title;
  if (has_front(chart)) {
    head += (head.empty() ? "" : ". ") + better(chart);
  }
  for (const std::string& line : wrapped(head, (chart_width - 40) / bold_width, tick_size)) {
    legend.svg += text_element(20, y, line, tick_size, fill(Ink::text) + " font-weight=\"bold\"");
    y += row_height;
  }
  const std::vector<LegendEntry> entries = legend_entries(chart);
  double widest = 1;
  bool one_line_each = true;
  for (const LegendEntry& entry : entries) {
    one_line_each = one_line_each && entry.text.size() == 1;
    for (const std::string& line : entry.text) {
      widest = std::max(widest, text_left + text_width(line, tick_size) + 14);
    }
  }
  const auto most = truncated<std::size_t>((chart_width - 30) / widest);
  const std::size_t columns = one_line_each ? std::max<std::size_t>(1, most) : 1;
  const std::size_t rows = (entries.size() + columns - 1) / columns;
  double bottom = y;
  double base = y;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (i % rows == 0) {
      base = y;
    }
    legend.svg += drawn(entries[i], 20 + widest * real(i / rows), base);
    base += row_height + (row_height - 4) * real(entries[i].text.size() - 1);
    bottom = std::max(bottom, base);
  }
  legend.bottom = bottom - 4;
  return legend;
}

bool has_front(const Chart& chart) { return chart.of_one_problem && chart.x.is_ranked && chart.y.is_ranked; }

bool has_failures(const Chart& chart) {
  return std::ranges::any_of(chart.series, [](const ChartSeries& series) { return !series.failures.empty(); });
}

}  // namespace tunica
