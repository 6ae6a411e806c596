#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

namespace tunica::report {
namespace {

// Columns of the page's table: fewer than the file's.
constexpr std::array shown_keys{"volume_ml",
                                "shells",
                                "distance_percent",
                                "min_angle_deg",
                                "membrane_p99_kpa",
                                "membrane_error_percent",
                                "stress_p99_kpa",
                                "stress_error_percent",
                                "strain_p99_percent",
                                "max_displacement_mm",
                                "displacement_error_percent",
                                "volume_change_percent",
                                "pressure_kpa",
                                "thickness_mm",
                                "seconds"};

Markup link_to(const CaseReport& one) { return part("link", {{"id", one.id()}, {"name", one.name}}); }

Markup counts(const std::vector<CaseReport>& cases) {
  const auto count = [&](const char* status) {
    return std::ranges::count_if(cases, [&](const CaseReport& one) { return status_of(one) == status; });
  };
  const auto class_of = [&](const char* status) { return count(status) > 0 ? status : "none"; };
  return part("counts", {{"done_class", class_of("done")},
                         {"done", count("done")},
                         {"failed_class", class_of("failed")},
                         {"failed", count("failed")},
                         {"warned_class", class_of("warned")},
                         {"warned", count("warned")}});
}

Markup failures(const std::vector<CaseReport>& cases) {
  Markup items;
  for (const CaseReport& one : cases) {
    if (one.source.done()) {
      continue;
    }
    Markup steps;
    for (const NextStep& next : next_steps(one)) {
      steps += part("failure_step", {{"what", next.what}, {"command", next.command}});
    }
    const std::string why = is_inaccurate(one.source)
                                ? one.redacted(accuracy_reached(one.source)->text()) + ": " + why_inaccurate(one)
                                : one.redacted(one.source.message);
    items += part("failure", {{"link", link_to(one)},
                              {"stage", one.source.stage == "none" ? "not begun" : one.source.stage},
                              {"exit", told_exit(one.source)},
                              {"why", why},
                              {"steps", steps}});
  }
  return items.text.empty() ? Markup{}
                            : heading(2, "Failures") += part("list", {{"class", "failures"}, {"items", items}});
}

// Which kinds of warnings there are, of how many cases, with an example.
Markup warnings_table(const std::vector<CaseReport>& cases) {
  std::vector<std::vector<ToldWarning>> warnings;
  std::ranges::transform(cases, std::back_inserter(warnings), &CaseReport::warnings);
  Markup rows;
  for (const WarningKind& kind : kinds_of(warnings)) {
    const CaseReport& first = cases[kind.cases.front()];
    rows += part("kind", {{"kind", shown_kind(kind.kind)},
                          {"serious", kind.weight == Weight::major ? " (serious)" : ""},
                          {"cases", kind.cases.size()},
                          {"link", link_to(first)},
                          {"stage", kind.example.stage},
                          {"text", kind.example.warning.text}});
  }
  if (rows.text.empty()) {
    return {};
  }
  return heading(2, "Warnings by kind") +=
         part("scroll", {{"name", "Warnings by kind"}, {"table", part("kinds", {{"rows", rows}})}});
}

// Measures that some case knows.
std::vector<const char*> known_keys(const std::vector<CaseReport>& cases) {
  std::vector<const char*> keys;
  std::ranges::copy_if(shown_keys, std::back_inserter(keys), [&](const char* key) {
    return !std::string_view(key).ends_with("_error_percent") || std::ranges::any_of(cases, [&](const CaseReport& one) {
      return measure(key).value(one.source).has_value();
    });
  });
  return keys;
}

Markup row_of(const CaseReport& one, const std::vector<const char*>& keys) {
  const std::string status = status_of(one);
  const Markup thumbnail =
      one.picture.empty() ? Markup{} : part("thumbnail", {{"picture", data_address("image/png", one.picture)}});
  Markup cells;
  for (const char* key : keys) {
    const Measure& what = measure(key);
    const auto value = what.value(one.source);
    const bool none = !value || (std::string_view(key) == "seconds" && *value == 0);
    cells += part("cell",
                  {{"number", none ? "" : fmt::format("{:.9g}", *value)}, {"shown", none ? "–" : what.text(*value)}});
  }
  return part("row", {{"status", status}, {"thumbnail", thumbnail}, {"link", link_to(one)}, {"cells", cells}});
}

// What the colours of the pictures mean, label by label.
Markup scale_note(const std::vector<CaseReport>& cases) {
  std::map<std::string, const CaseReport*> organs;
  for (const CaseReport& one : cases) {
    if (one.picture_top > 0) {
      organs.emplace(one.organ_kind, &one);
    }
  }
  std::string text;
  for (const auto& [organ, one] : organs) {
    text += fmt::format("{}{}0 to {} kPa", text.empty() ? "" : "; ", organs.size() > 1 ? one->organ_name + ": " : "",
                        figure(one->picture_top * 1e3));
  }
  return text.empty() ? Markup{} : part("scale", {{"ranges", text}});
}

Markup table(const std::vector<CaseReport>& cases, const std::string& tsv) {
  Markup columns;
  const std::vector<const char*> keys = known_keys(cases);
  for (const char* key : keys) {
    const Measure& what = measure(key);
    columns += part("column", {{"description", what.description},
                               {"title", what.title},
                               {"unit", what.unit.empty() ? Markup{} : part("column_unit", {{"unit", what.unit}})}});
  }
  Markup rows;
  for (const CaseReport& one : cases) {
    rows += row_of(one, keys);
  }
  Markup made = heading(2, "Cases");
  made += part("scroll", {{"name", "Table of the cases"},
                          {"table", part("cohort_table", {{"columns", columns}, {"rows", rows}})}});
  made += scale_note(cases);
  return made += part("table_as_file", {{"address", data_address("text/tab-separated-values", tsv)}});
}

using CaseGroup = std::vector<const CaseReport*>;

Markup spread_of(const CaseGroup& cases) {
  Markup strips;
  Markup items;
  for (const Measure& what : measures()) {
    std::vector<std::optional<double>> values;
    for (const CaseReport* one : cases) {
      values.push_back(what.compared ? what.value(one->source) : std::nullopt);
    }
    const std::vector<Outlier> found = outliers(values);
    std::vector<StripMark> marks;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i]) {
        const bool out = std::ranges::find(found, i, &Outlier::index) != found.end();
        marks.push_back({*values[i], cases[i]->name, out});
      }
    }
    strips += strip_plot(what, marks);
    for (const Outlier& outlier : found) {
      items += part("outlier", {{"link", link_to(*cases[outlier.index])},
                                {"title", what.title},
                                {"value", what.text(*values[outlier.index])},
                                {"unit", what.unit},
                                {"z", fmt::format("{:+.1f}", outlier.z)}});
    }
  }
  if (cases.size() < fewest_compared) {
    return part("paragraph", {{"text", "Too few cases to tell outliers."}});
  }
  Markup made = items.text.empty() ? part("paragraph", {{"text", "No outlier."}})
                                   : part("list", {{"class", "outliers"}, {"items", items}});
  return made += part("strips", {{"strips", strips}});
}

Markup spread(const std::vector<CaseReport>& cases) {
  std::map<std::string, CaseGroup> organs;
  for (const CaseReport& one : cases) {
    if (one.source.done()) {
      organs[one.organ_kind].push_back(&one);
    }
  }
  Markup made = heading(2, "Spread and outliers");
  made += part("outlier_rule");
  for (const auto& [organ, group] : organs) {
    if (organs.size() > 1) {
      made += heading(3, group.front()->organ_name);
    }
    made += spread_of(group);
  }
  return made;
}

}  // namespace

Markup cohort_section(const std::vector<CaseReport>& cases, const std::string& tsv) {
  Markup made = counts(cases);
  made += failures(cases);
  made += warnings_table(cases);
  made += table(cases, tsv);
  made += spread(cases);
  return made;
}

std::string cohort_tsv(const std::vector<CaseReport>& cases) {
  std::string text = "case\tstatus\tstage\texit\tmessage\twarnings\twarning_kinds";
  for (const Measure& what : measures()) {
    text += "\t" + what.key;
  }
  text += "\n";
  for (const CaseReport& one : cases) {
    for (const std::string& field :
         {one.name, status_of(one), one.source.stage, one.source.exit, one.redacted(one.source.message)}) {
      text += (field.empty() ? "n/a" : in_one_line(field)) + "\t";
    }
    const std::string kinds = kinds_in_one_line(one.warnings);
    text += fmt::format("{}\t{}", one.warnings.size(), kinds.empty() ? "n/a" : in_one_line(kinds));
    for (const Measure& what : measures()) {
      const auto value = what.value(one.source);
      text += value ? fmt::format("\t{:.9g}", *value) : "\tn/a";
    }
    text += "\n";
  }
  return text;
}

std::string cohort_columns() {
  const auto column = [](const std::string& description, const std::string& unit, const std::string& source) {
    return Json{{"Description", description}, {"Units", unit.empty() ? Json("n/a") : Json(unit)}, {"Source", source}};
  };
  Json columns;
  columns["case"] = column("Volume and label, or a number where names are left out.", "", "folder");
  columns["status"] = column("done, warned (done, with warnings) or failed.", "", "all stages");
  columns["stage"] = column("The last stage that was run.", "", "pipeline");
  columns["exit"] = column("Its exit code.", "", "pipeline");
  columns["message"] = column("done, or why it is not.", "", "error of that stage");
  columns["warnings"] = column("Number of warnings of all stages.", "", "all stages: warnings");
  columns["warning_kinds"] =
      column("Their kinds, the heaviest first, and how often each is there.", "", "all stages: warning_kinds");
  for (const Measure& what : measures()) {
    columns[what.key] = column(what.description, what.unit, what.source);
  }
  return columns.dump(2) + "\n";
}

}  // namespace tunica::report
