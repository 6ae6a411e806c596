#include "tunica/report/report.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/report/detail/html.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/told_warnings.hpp"
#include "tunica/report/report_chart.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

namespace tunica::report {
namespace {

using Row = std::vector<std::string>;

/// A measure in the tables that end a run.
struct Shown {
  const char* key;                  ///< the measure's, and the head in the file
  const char* head;                 ///< on the terminal
  const char* estimates = nullptr;  ///< the answer whose error it is
};
// What the answer is and how far it holds; the distance, which is one of shapes, stands apart from it.
constexpr std::array shown_measures{Shown{"shells", "shells"},
                                    Shown{"distance_percent", "distance %"},
                                    Shown{"membrane_p99_kpa", "membrane kPa"},
                                    Shown{"membrane_error_percent", "+- %", "membrane_p99_mpa"},
                                    Shown{"membrane_mean_kpa", "mean kPa"},
                                    Shown{"stress_p99_kpa", "faces kPa"},
                                    Shown{"stress_error_percent", "+- %", "stress_p99_mpa"},
                                    Shown{"max_displacement_mm", "displ. mm"},
                                    Shown{"displacement_error_percent", "+- %", "max_displacement_mm"},
                                    Shown{"strain_p99_percent", "strain %"}};

std::string seconds_of(const PipelineCase& one) {
  return fmt::format("{:.2f}", measure("seconds").value(one).value_or(0));
}

Row row_of_file(const PipelineCase& one) {
  Row row{one.name, one.stage, one.exit, one.message};
  for (const Shown& shown : shown_measures) {
    const Measure& what = measure(shown.key);
    const auto value = what.value(one);
    row.push_back(!value              ? ""
                  : what.unit.empty() ? fmt::format("{:.0f}", *value)
                  : what.is_bound     ? fmt::format("{:.4g}", rounded_upwards(*value, 4))
                                      : fmt::format("{:.6g}", *value));
  }
  row.push_back(std::to_string(told_warnings(one).size()));
  row.push_back(seconds_of(one));
  std::ranges::transform(row, row.begin(), in_one_line);
  return row;
}

bool is_doubtful(const PipelineCase& one, const Shown& shown) {
  return shown.estimates != nullptr &&
         one.at("simulate", fmt::format("result.estimates.{}.credible", shown.estimates)) == false;
}

Row row_of_terminal(const PipelineCase& one) {
  Row row{one.name, one.stage, one.exit};
  for (const Shown& shown : shown_measures) {
    const Measure& what = measure(shown.key);
    const auto value = what.value(one);
    row.push_back(!value ? "" : what.text(*value) + (is_doubtful(one, shown) ? "?" : ""));
  }
  const std::size_t warnings = told_warnings(one).size();
  row.push_back(warnings > 0 ? std::to_string(warnings) : "");
  row.push_back(seconds_of(one));
  row.push_back(one.message);
  std::ranges::transform(row, row.begin(), in_one_line);
  return row;
}

// Characters of a text in UTF-8.
std::size_t width(const std::string& text) {
  return narrow<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

// Columns that are empty in all rows but the head's are left out. @param numbers  the columns that are set to the right
std::string in_columns(const std::vector<Row>& rows, std::size_t first_number, std::size_t last_number) {
  std::vector<std::size_t> widths(rows.front().size());
  for (std::size_t i = 0; i < widths.size(); ++i) {
    std::size_t filled = 0;
    for (const Row& row : rows) {
      widths[i] = std::max(widths[i], width(row[i]));
      filled += row[i].empty() ? 0 : 1;
    }
    widths[i] = filled > 1 ? widths[i] : 0;
  }
  std::string text;
  for (const Row& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < widths.size(); ++i) {
      if (widths[i] > 0) {
        const std::string blanks(widths[i] - width(row[i]), ' ');
        line += i >= first_number && i <= last_number ? blanks + row[i] + "  " : row[i] + blanks + "  ";
      }
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  return text;
}

// What the heads mean, of columns that have a number.
std::string meanings(const std::vector<PipelineCase>& cases) {
  const auto any = [&](const char* key) {
    return std::ranges::any_of(cases, [&](const PipelineCase& one) { return measure(key).value(one).has_value(); });
  };
  std::string text;
  if (any("stress_p99_kpa")) {
    text +=
        "membrane: von Mises stress of the middle of the wall, faces: at either face, strain: largest principal, all "
        "the "
        "99th percentile by area; mean: of the membrane stress over the area; displ.: the largest, since the image; of "
        "a motion all are those at its end\n";
  }
  if (any("membrane_error_percent") || any("stress_error_percent") || any("displacement_error_percent")) {
    text += "+-: estimated error of the number before it, by number of shells and model; ?: not credible\n";
  }
  if (any("distance_percent")) {
    text += "distance: between shells and surface, at most, in % of its diagonal; not the error of stress\n";
  }
  return text;
}

std::string warnings_text(const std::vector<PipelineCase>& cases) {
  std::vector<std::vector<ToldWarning>> warnings;
  std::ranges::transform(cases, std::back_inserter(warnings), told_warnings);
  std::string text;
  for (const WarningKind& kind : kinds_of(warnings)) {
    text += in_one_line(
                fmt::format("  {}, {}: {}{}: {}", shown_kind(kind.kind),
                            cases.size() == 1 ? "here" : fmt::format("{} of {} cases", kind.cases.size(), cases.size()),
                            cases.size() == 1 ? "" : fmt::format("e.g. {}: ", cases[kind.cases.front()].name),
                            kind.example.stage, kind.example.warning.text)) +
            "\n";
  }
  return text.empty() ? text : "warnings, by kind:\n" + text;
}

}  // namespace

std::string summary_tsv(const std::vector<PipelineCase>& cases) {
  Row heads{"case", "stage", "exit", "message"};
  std::ranges::transform(shown_measures, std::back_inserter(heads), &Shown::key);
  heads.insert(heads.end(), {"warnings", "seconds"});
  std::string text = fmt::format("{}\n", fmt::join(heads, "\t"));
  for (const PipelineCase& one : cases) {
    text += fmt::format("{}\n", fmt::join(row_of_file(one), "\t"));
  }
  return text;
}

std::string summary_text(const std::vector<PipelineCase>& cases) {
  Row heads{"case", "stage", "exit"};
  const std::size_t first_number = heads.size();
  std::ranges::transform(shown_measures, std::back_inserter(heads), &Shown::head);
  heads.insert(heads.end(), {"warnings", "seconds", "message"});
  std::vector<Row> rows{heads};
  std::ranges::transform(cases, std::back_inserter(rows), row_of_terminal);
  std::string text = in_columns(rows, first_number, heads.size() - 2);
  text += meanings(cases);
  text += warnings_text(cases);
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
