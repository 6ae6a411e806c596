#include "tunica/report/report_chart.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

namespace tunica {
namespace {

using Numbers = std::vector<std::optional<double>>;

// The error of the answer as the run itself estimates it: of a run for an accuracy, and of any other run with a target.
constexpr const char* estimate_key = "result.accuracy.estimate_percent";
constexpr const char* membrane_estimate_key = "result.estimates.membrane_p99_mpa.percent";

struct KeyWords {
  std::string label, unit;
};

// What a dotted key names, and its unit; no words where it names nothing.
KeyWords words_of_key(const std::string& key) {
  static const std::map<std::string, std::string> units{
      {"percent", "%"}, {"mm", "mm"},   {"mm2", "mm²"},      {"mm3", "mm³"}, {"deg", "°"},
      {"mj", "mJ"},     {"hz", "Hz"},   {"s", "s"},          {"rad", "rad"}, {"mib", "MiB"},
      {"ms", "ms"},     {"mpa", "MPa"}, {"n_per_mm", "N/mm"}};
  std::vector<std::string> parts;
  for (std::size_t start = 0; start <= key.size();) {
    const std::size_t dot = std::min(key.find('.', start), key.size());
    parts.push_back(key.substr(start, dot - start));
    start = dot + 1;
  }
  std::string unit;
  std::vector<std::string> words;
  bool distance = false;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::string part = parts[i];
    if (i + 1 < parts.size() && (part == "result" || part == "iterations" || part == "probes" || part == "study")) {
      continue;
    }
    if (part == "*" || (!part.empty() && part.find_first_not_of("0123456789-") == std::string::npos)) {
      continue;
    }
    if (part == "seconds") {
      unit = "s";
      words.emplace_back(i + 1 < parts.size() && parts[i + 1] == "total" ? "total time" : "time");
      if (i + 1 < parts.size()) {
        if (parts[i + 1] != "total") {
          words.back() += " to " + parts[i + 1];
        }
        ++i;
      }
      continue;
    }
    if (part == "ms_per_step") {
      unit = "ms";
      words.emplace_back("time per step");
      continue;
    }
    if (const auto found = units.find(part); found != units.end() && i > 0) {
      unit = found->second;
      continue;
    }
    for (std::size_t at = part.find('_'); at != std::string::npos; at = part.find('_', at + 1)) {
      if (const auto found = units.find(part.substr(at + 1)); found != units.end()) {
        unit = found->second;
        part.resize(at);
        break;
      }
    }
    distance = distance || part.find("hausdorff") != std::string::npos || part.find("one_sided") != std::string::npos ||
               part == "mean" || part == "rms";
    part = part == "hausdorff"        ? "Hausdorff distance"
           : part == "flat_hausdorff" ? "Hausdorff distance of the flat facets"
           : part == "one_sided"      ? "one-sided distance"
           : part == "mean"           ? "mean distance"
           : part == "rms"            ? "root mean square distance"
           : part == "upper"          ? "upper bound"
           : part == "lower"          ? "lower bound"
           : part == "dof"            ? "degrees of freedom"
           : part == "estimate"       ? "estimated error"
           : part == "estimates"      ? "estimated error"
           : part == "membrane_p99"   ? "membrane stress p99"
           : part == "peak"           ? "peak memory"
           : part == "triangles_in"   ? "triangles before"
                                      : part;
    std::ranges::replace(part, '_', ' ');
    words.push_back(part);
  }
  std::string label = fmt::format("{}", fmt::join(words, ", "));
  return {std::move(label), unit == "%" && distance ? "% of the diagonal" : unit};
}

// A coordinate of the chart: its key or name, its label, and the values of each report.
struct Coordinate {
  std::string key;
  std::string label;
  std::vector<Numbers> values;
};

std::string middle_stage(const Report& report) {
  static const std::map<std::string, std::string> stages{{"tunica-simulate", "solve"}};
  const std::string tool = report.tool();
  const auto stage = stages.find(tool);
  return "seconds." + (stage != stages.end() ? stage->second : tool.substr(std::string("tunica-").size()));
}

bool all_of_tool(const std::vector<Report>& reports, const std::string& tool) {
  return std::ranges::all_of(reports, [&](const Report& report) { return report.tool() == tool; });
}

bool all_have(const std::vector<Report>& reports, const std::string& key) {
  return std::ranges::all_of(reports, [&](const Report& report) { return has_number(report, key); });
}

Coordinate by_key(const std::vector<Report>& reports, const std::string& key) {
  Coordinate coordinate{key, describe_key(key), {}};
  for (const Report& report : reports) {
    coordinate.values.push_back(numbers_at(report, key));
  }
  return coordinate;
}

Coordinate time_of(const std::vector<Report>& reports) {
  const std::string step = "result.ms_per_step.median";
  // Of a run for an accuracy it is the time of its finest level alone.
  if (all_of_tool(reports, "tunica-simulate") && all_have(reports, step) && !all_have(reports, estimate_key)) {
    return by_key(reports, step);
  }
  if (all_of_tool(reports, reports.front().tool())) {
    return by_key(reports, middle_stage(reports.front()));
  }
  Coordinate time{"seconds", "Time of the algorithm (s)", {}};
  for (const Report& report : reports) {
    time.values.push_back(numbers_at(report, middle_stage(report)));
  }
  return time;
}

Numbers volume_error(const Report& report) {
  const auto mesh = numbers_at(report, "result.volume_mm3").front();
  const auto voxels = numbers_at(report, "result.voxel_volume_mm3").front();
  if (!mesh || !voxels || !(*voxels > 0)) {
    return {std::nullopt};
  }
  return {100 * std::abs(*mesh - *voxels) / *voxels};
}

Coordinate natural_error(const std::vector<Report>& reports) {
  if (all_of_tool(reports, "tunica-extract")) {
    Coordinate error{"volume_error_percent", "Volume of the mesh against the voxels (%)", {}};
    for (const Report& report : reports) {
      error.values.push_back(volume_error(report));
    }
    return error;
  }
  for (const char* key :
       {"result.hausdorff_percent.upper", estimate_key, membrane_estimate_key, "result.algebraic_error_percent"}) {
    if (all_have(reports, key)) {
      return by_key(reports, key);
    }
  }
  if (all_of_tool(reports, "tunica-simulate")) {
    // What is left unbalanced is not the error of the model, but all that a single simulation knows.
    return by_key(reports, "result.residual");
  }
  return by_key(reports, "result.hausdorff_percent.upper");
}

Coordinate error_to_reference(const std::vector<Report>& reports, const Report& reference) {
  Coordinate error{"error_percent", {}, {}};
  const Report* first = nullptr;
  for (const Report& report : reports) {
    const ReferenceError found = error_against(report, reference);
    if (first != nullptr && found.quantity != error.label) {
      throw InputError(fmt::format("{}: can be compared with the reference by '{}', but {} by '{}'; give --y a key",
                                   report.path.string(), found.quantity, first->path.string(), error.label));
    }
    first = &report;
    error.label = found.quantity;
    error.values.push_back({found.percent});
  }
  return error;
}

Coordinate key_against_reference(const std::vector<Report>& reports, const std::string& key, const Report& reference) {
  const Numbers truth = numbers_at(reference, key);
  if (truth.empty() || !truth.back()) {
    throw InputError(fmt::format("{}: the reference has no number under '{}'", reference.path.string(), key));
  }
  Coordinate error = by_key(reports, key);
  const std::string label = words_of_key(key).label;
  error.key = key + " error_percent";
  error.label = fmt::format("Error of {}{} (%)", label.starts_with("Hausdorff") || label.empty() ? "" : "the ",
                            label.empty() ? key : label);
  for (Numbers& numbers : error.values) {
    for (auto& number : numbers) {
      if (number) {
        const double percent = 100 * std::abs(*number - *truth.back()) / std::abs(*truth.back());
        number = *number == *truth.back() ? std::optional(0.0)
                 : std::isfinite(percent) ? std::optional(percent)
                                          : std::nullopt;
      }
    }
  }
  return error;
}

// The content of the surface to which a run's shells are held; empty where it names none.
std::string target_of(const Report& report) {
  const auto member = [](const Json& object, const char* key) {
    return object.is_object() ? object.value(key, Json()) : Json();
  };
  const Json arguments = member(report.json, "arguments");
  const Json named =
      member(arguments, "TARGET").is_null() ? member(arguments, "--target") : member(arguments, "TARGET");
  const Json inputs = member(report.json, "inputs");
  for (const Json& input : inputs.is_array() ? inputs : Json::array()) {
    const Json hash = member(input, "sha256");
    if (named.is_string() && member(input, "path") == named && hash.is_string()) {
      return hash.get<std::string>();
    }
  }
  return {};
}

// Runs held to other surfaces, as of a cohort's patients, are neither better nor worse than each other.
bool are_of_one_problem(const std::vector<Report>& reports) {
  std::set<std::string> targets;
  std::ranges::transform(reports, std::inserter(targets, targets.end()), target_of);
  return targets.size() == 1 || targets.contains("");
}

void warn_of_other_inputs(const std::vector<Report>& reports, const Report& reference, std::vector<Warning>& warnings) {
  std::string first;
  std::size_t count = 0;
  for (const Report& report : reports) {
    std::vector<std::string> other = stated_otherwise(report, reference);
    if (!are_of_one_problem({report, reference})) {
      other.emplace_back("another target");
    }
    if (!other.empty() && count++ == 0) {
      first = fmt::format("{} ({})", report.path.string(), fmt::join(other, "; "));
    }
  }
  if (count > 0) {
    warnings.push_back(
        {Weight::major, "other inputs",
         fmt::format("{} of {} runs are of another target, wall, load or support than the reference, the first "
                     "{}: how far they differ is no error of theirs; give a reference of the same "
                     "inputs",
                     count, reports.size(), first)});
  }
}

std::string shown(const Json& value) {
  if (value.is_string()) {
    return value.get<std::string>();
  }
  if (value.is_number_float()) {
    return fmt::format("{:.6g}", value.get<double>());
  }
  return value.is_null() ? "none" : value.dump();
}

// The texts under a key, one per element of a list, or one.
std::vector<std::string> texts_at(const Report& report, const std::string& key) {
  if (key == "file") {
    return {report.name};
  }
  std::vector<std::string> texts;
  for (const Json& value : values_at(report, key).values) {
    texts.push_back(shown(value));
  }
  return texts;
}

// Orders the names of series: by value where all are numbers, else as they came.
void sort_series(std::vector<ChartSeries>& series) {
  const auto number = [](const ChartSeries& entry) -> std::optional<double> {
    try {
      std::size_t end = 0;
      const double value = std::stod(entry.name, &end);
      return end == entry.name.size() ? std::optional(value) : std::nullopt;
    } catch (const std::exception&) {
      return {};
    }
  };
  if (std::ranges::all_of(series, [&](const ChartSeries& entry) { return number(entry).has_value(); })) {
    std::ranges::stable_sort(series,
                             [&](const ChartSeries& a, const ChartSeries& b) { return *number(a) < *number(b); });
  }
}

bool more_is_better(const std::string& key) {
  constexpr std::array<const char*, 3> names{"min_angle_deg", "mean_quality", "real_time_factor"};
  return std::ranges::any_of(names, [&](const char* name) { return key.find(name) != std::string::npos; });
}

/// Whether less or more of a key is better: of costs, errors and qualities, not of counts and parameters.
bool is_ranked(const std::string& key) {
  constexpr std::array words{"second", "ms_per_step", "mib", "error", "hausdorff", "distance", "residual", "gap"};
  return more_is_better(key) ||
         std::ranges::any_of(words, [&](std::string_view word) { return key.find(word) != std::string::npos; });
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) {
    return text;
  }
  std::string quoted = "\"";
  for (const char c : text) {
    quoted += c;
    if (c == '"') {
      quoted += c;
    }
  }
  return quoted + "\"";
}

struct Row {
  const Report* report = nullptr;
  std::size_t index = 0;
  std::string series;
  ChartMark mark;
};

// Pairs of coordinates; a single value is repeated along a list. Pairs with a null are left out and counted.
std::vector<Row> rows_of(const std::vector<Report>& reports, const Coordinate& x, const Coordinate& y,
                         const ReportChartOptions& options, std::vector<Warning>& warnings) {
  std::vector<Row> rows;
  for (std::size_t r = 0; r < reports.size(); ++r) {
    const Report& report = reports[r];
    const std::size_t count = std::max(x.values[r].size(), y.values[r].size());
    const auto series = options.series ? texts_at(report, *options.series) : std::vector<std::string>{""};
    const auto labels = options.label ? texts_at(report, *options.label) : std::vector<std::string>{""};
    const auto pick = [&](const auto& list, std::size_t i, const std::string& key) {
      if (list.size() != 1 && list.size() != count) {
        throw InputError(fmt::format("{}: '{}' has {} values, but '{}' and '{}' have {}: they do not pair up",
                                     report.path.string(), key, list.size(), x.key, y.key, count));
      }
      return list[list.size() == 1 ? 0 : i];
    };
    std::size_t undefined = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto px = pick(x.values[r], i, x.key);
      const auto py = pick(y.values[r], i, y.key);
      if (!px || !py) {
        ++undefined;
        continue;
      }
      rows.push_back({&report,
                      i,
                      pick(series, i, options.series.value_or("")),
                      {*px, *py, report.name, pick(labels, i, options.label.value_or(""))}});
    }
    if (undefined > 0) {
      warnings.push_back({Weight::minor, "left out",
                          fmt::format("{}: {} of {} values of '{}' against '{}' are undefined (null) and left out",
                                      report.path.string(), undefined, count, y.key, x.key)});
    }
  }
  return rows;
}

void drop_negative(std::vector<Row>& rows, const ReportChartOptions& options, std::vector<Warning>& warnings) {
  const std::size_t before = rows.size();
  std::erase_if(rows, [&](const Row& row) {
    return (options.x_scale == Scale::logarithmic && row.mark.x < 0) ||
           (options.y_scale == Scale::logarithmic && row.mark.y < 0);
  });
  if (rows.size() < before) {
    warnings.push_back(
        {Weight::minor, "left out",
         fmt::format("{} marks with negative values have no place on a logarithmic axis and are left out",
                     before - rows.size())});
  }
}

struct Failure {
  const Report* report = nullptr;
  std::string series;
  ChartFailure mark;
};

std::vector<Failure> failures_of(const std::vector<Report>& failed, const std::string& x,
                                 const ReportChartOptions& options) {
  std::vector<Failure> failures;
  for (const Report& report : failed) {
    const auto number = has_number(report, x) ? numbers_at(report, x).back() : std::nullopt;
    const bool shown = number && !(options.x_scale == Scale::logarithmic && *number < 0);
    failures.push_back({&report,
                        options.series ? texts_at(report, *options.series).front() : "",
                        {shown ? number : std::nullopt, report.name,
                         options.failed ? texts_at(report, *options.failed).front() : ""}});
  }
  return failures;
}

std::string csv_of(const std::vector<std::pair<Row, bool>>& rows, const std::vector<Failure>& failures,
                   const Coordinate& x, const Coordinate& y, const ReportChartOptions& options) {
  std::string csv = fmt::format("report,tool,index,{},{},{},pareto_front,failed,command,made_by\n",
                                csv_field(options.series ? "series " + *options.series : "series"), csv_field(x.key),
                                csv_field(y.key));
  std::string made_by = csv_field(options.made_by);
  const auto command = [](const Report& report) {
    const auto found = report.json.find("command");
    return csv_field(found != report.json.end() ? shown(*found) : "");
  };
  for (const auto& [row, front] : rows) {
    csv += fmt::format("{},{},{},{},{},{},{},,{},{}\n", csv_field(row.report->path.string()),
                       csv_field(row.report->tool()), row.index, csv_field(row.series), row.mark.x, row.mark.y,
                       front ? 1 : 0, command(*row.report), std::exchange(made_by, ""));
  }
  for (const Failure& failure : failures) {
    csv += fmt::format("{},{},0,{},{},,0,{},{},{}\n", csv_field(failure.report->path.string()),
                       csv_field(failure.report->tool()), csv_field(failure.series),
                       failure.mark.x ? fmt::format("{}", *failure.mark.x) : "", csv_field(failure.mark.label),
                       command(*failure.report), std::exchange(made_by, ""));
  }
  return csv;
}

}  // namespace

ReportChart chart_of_reports(const std::vector<Report>& reports, const std::vector<Report>& failed,
                             const ReportChartOptions& options) {
  TUNICA_ASSERT(!reports.empty());
  const Coordinate x = options.x ? by_key(reports, *options.x) : time_of(reports);
  const Coordinate y = options.y && options.reference ? key_against_reference(reports, *options.y, *options.reference)
                       : options.y                    ? by_key(reports, *options.y)
                       : options.reference            ? error_to_reference(reports, *options.reference)
                                                      : natural_error(reports);
  ReportChart made;
  made.x_key = x.key;
  made.y_key = y.key;
  if (options.reference) {
    warn_of_other_inputs(reports, *options.reference, made.warnings);
  }
  std::vector<Row> rows = rows_of(reports, x, y, options, made.warnings);
  drop_negative(rows, options, made.warnings);
  if (rows.empty()) {
    throw InputError(fmt::format("{}: nothing to draw: no run has both '{}' and '{}'{}", reports.front().path.string(),
                                 x.key, y.key, made.warnings.empty() ? "" : "; " + made.warnings.back().text));
  }

  Chart& chart = made.chart;
  chart.title = options.title;
  chart.x = {options.x_label.value_or(x.label), options.x_scale, more_is_better(x.key), is_ranked(x.key)};
  chart.y = {options.y_label.value_or(y.label), options.y_scale, !options.reference && more_is_better(y.key),
             options.reference || is_ranked(y.key)};
  // Marks of a list belong together: without --series each report is a line of its own.
  const bool lists = std::ranges::any_of(rows, [](const Row& row) { return row.index > 0; });
  const bool named = options.series.has_value();
  const std::vector<Failure> failures = failures_of(failed, x.key, options);
  chart.series_title = named ? (*options.series == "file" ? "File" : describe_key(*options.series)) : "";
  std::map<std::string, std::size_t> place;
  std::map<const Report*, std::size_t> line_of;
  for (const Row& row : rows) {
    const std::string name = named ? row.series : lists && reports.size() > 1 ? row.mark.name : "";
    const auto [entry, added] = place.try_emplace(name, chart.series.size());
    if (added) {
      chart.series.push_back({name, {}, lists || options.joined});
    }
    chart.series[entry->second].marks.push_back(row.mark);
  }
  for (const Failure& failure : failures) {
    const auto [entry, added] = place.try_emplace(failure.series, chart.series.size());
    if (added) {
      chart.series.push_back({failure.series, {}, options.joined});
    }
    chart.series[entry->second].failures.push_back(failure.mark);
  }
  sort_series(chart.series);
  if (options.joined) {
    for (ChartSeries& series : chart.series) {
      std::ranges::stable_sort(series.marks, [](const ChartMark& a, const ChartMark& b) { return a.x < b.x; });
    }
  }

  chart.guide = options.guide;
  chart.of_one_problem = options.reference || are_of_one_problem(reports);
  made.marks = rows.size();
  made.failures = failures.size();
  const auto front = pareto_front(chart);
  for (const auto& flags : front) {
    made.on_front += narrow<std::size_t>(std::ranges::count(flags, true));
  }
  std::vector<std::pair<double, double>> on_front;
  for (std::size_t s = 0; s < front.size(); ++s) {
    for (std::size_t m = 0; m < front[s].size(); ++m) {
      if (front[s][m]) {
        on_front.emplace_back(chart.series[s].marks[m].x, chart.series[s].marks[m].y);
      }
    }
  }
  std::ranges::sort(on_front);
  std::vector<std::pair<Row, bool>> flagged;
  for (Row& row : rows) {
    const bool best = std::ranges::binary_search(on_front, std::pair(row.mark.x, row.mark.y));
    flagged.emplace_back(std::move(row), best);
  }
  made.csv = csv_of(flagged, failures, x, y, options);
  return made;
}

std::string describe_key(const std::string& key) {
  auto [label, unit] = words_of_key(key);
  if (label.empty()) {
    return key;
  }
  label.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(label.front())));
  return unit.empty() ? label : fmt::format("{} ({})", label, unit);
}

}  // namespace tunica
