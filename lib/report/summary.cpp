#include "tunica/report/report.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/io/result/report_chart.hpp"
#include "tunica/report/detail/html.hpp"
#include "tunica/report/detail/measures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace tunica::report {
namespace {

enum Column : std::size_t { name, stage, code, message, shells, error, seconds, columns };
using Row = std::array<std::string, columns>;

const Row heads{"case", "stage", "exit", "message", "shells", "error_percent", "seconds"};

Row row_of(const PipelineCase& one) {
  Row row{one.name, one.stage, one.exit, one.message, "", "", ""};
  if (const auto count = measure("shells").value(one)) {
    row[shells] = fmt::format("{:.0f}", *count);
  }
  if (const auto percent = measure("distance_percent").value(one)) {
    row[error] = fmt::format("{:.4g}", rounded_upwards(*percent, 4));
  }
  row[seconds] = fmt::format("{:.2f}", measure("seconds").value(one).value_or(0));
  std::ranges::transform(row, row.begin(), in_one_line);
  return row;
}

// Characters of a text in UTF-8.
std::size_t width(const std::string& text) {
  return narrow<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

std::vector<Row> rows_of(const std::vector<PipelineCase>& cases) {
  std::vector<Row> rows{heads};
  std::ranges::transform(cases, std::back_inserter(rows), row_of);
  return rows;
}

}  // namespace

std::string summary_tsv(const std::vector<PipelineCase>& cases) {
  std::string text;
  for (const Row& row : rows_of(cases)) {
    for (std::size_t i = 0; i < columns; ++i) {
      text += row[i] + (i + 1 < columns ? "\t" : "\n");
    }
  }
  return text;
}

std::string summary_text(const std::vector<PipelineCase>& cases) {
  const std::vector<Row> rows = rows_of(cases);
  std::array<std::size_t, columns> widths{};
  for (const Row& row : rows) {
    for (std::size_t i = 0; i < columns; ++i) {
      widths[i] = std::max(widths[i], width(row[i]));
    }
  }
  std::string text;
  for (const Row& row : rows) {
    for (const Column left : {name, stage, code}) {
      text += row[left] + std::string(widths[left] - width(row[left]) + 2, ' ');
    }
    for (const Column right : {shells, error, seconds}) {
      text += std::string(widths[right] - width(row[right]), ' ') + row[right] + "  ";
    }
    text += row[message] + "\n";
  }
  for (const PipelineCase& one : cases) {
    if (one.done()) {
      // Of shells that an accuracy refined there is no map.
      const std::string map = is_refitted(one) ? "" : "   error map: " + (one.folder / "map.png").string();
      text += fmt::format("result: {}{}\n", (one.folder / "result.hdf").string(), map);
    }
  }
  return text;
}

std::optional<std::string> summary_chart(const std::vector<PipelineCase>& cases) {
  std::vector<Report> reports;
  for (const PipelineCase& one : cases) {
    if (one.at("relax", "ok") == true) {
      reports.push_back({one.folder / "relax.json", "relax", one.reports.at("relax")});
    }
  }
  if (reports.empty()) {
    return std::nullopt;
  }
  name_apart(reports);
  ReportChartOptions options;
  options.label = "file";
  try {
    return chart_svg(chart_of_reports(reports, {}, options).chart);
  } catch (const InputError&) {
    return std::nullopt;  // reports of another version, that lack what is drawn
  }
}

}  // namespace tunica::report
