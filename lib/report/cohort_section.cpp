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

Markup link_to(const CaseReport& one) { return html("<a href=\"#{}\"><bdi>{}</bdi></a>", one.id(), one.name); }

Markup counts(const std::vector<CaseReport>& cases) {
  const auto count = [&](const char* status) {
    return std::ranges::count_if(cases, [&](const CaseReport& one) { return status_of(one) == status; });
  };
  return html(
      "<dl class=\"counts\"><div class=\"{}\"><dt>Done, no warning</dt><dd>{}</dd></div>"
      "<div class=\"{}\"><dt>Failed</dt><dd>{}</dd></div><div class=\"{}\"><dt>Done, with "
      "warnings</dt><dd>{}</dd></div></dl>\n",
      count("done") > 0 ? "done" : "none", count("done"), count("failed") > 0 ? "failed" : "none", count("failed"),
      count("warned") > 0 ? "warned" : "none", count("warned"));
}

Markup failures(const std::vector<CaseReport>& cases) {
  Markup items;
  for (const CaseReport& one : cases) {
    if (one.source.done()) {
      continue;
    }
    Markup steps;
    for (const NextStep& next : next_steps(one)) {
      steps += html("<br>{}: <code>{}</code>", next.what, next.command);
    }
    const std::string why = is_inaccurate(one.source)
                                ? one.redacted(accuracy_reached(one.source)->text()) + ": " + why_inaccurate(one)
                                : one.redacted(one.source.message);
    items += html("<li>{}: {}{}: {}{}</li>\n", link_to(one),
                  one.source.stage == "none" ? "not begun" : one.source.stage, told_exit(one.source), why, steps);
  }
  return items.text.empty() ? Markup{} : heading(2, "Failures") += html("<ul class=\"failures\">\n{}</ul>\n", items);
}

// Which kinds of warnings there are, of how many cases, with an example.
Markup warnings_table(const std::vector<CaseReport>& cases) {
  std::vector<std::vector<ToldWarning>> warnings;
  std::ranges::transform(cases, std::back_inserter(warnings), &CaseReport::warnings);
  Markup rows;
  for (const WarningKind& kind : kinds_of(warnings)) {
    const CaseReport& first = cases[kind.cases.front()];
    rows += html("<tr><th scope=\"row\">{}{}</th><td class=\"number\">{}</td><td>{}: {}: {}</td></tr>\n",
                 shown_kind(kind.kind), kind.weight == Weight::major ? " (serious)" : "", kind.cases.size(),
                 link_to(first), kind.example.stage, kind.example.warning.text);
  }
  if (rows.text.empty()) {
    return {};
  }
  return heading(2, "Warnings by kind") += html(
             "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Warnings by kind\"><table "
             "class=\"facts grid kinds\"><caption>The heaviest first; each case counts once for a kind</caption>"
             "<thead><tr><th scope=\"col\">Kind</th><th scope=\"col\">Cases</th><th scope=\"col\">Example</th></tr>"
             "</thead><tbody>\n{}</tbody></table></div>\n",
             rows);
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
  Markup row = html("<tr class=\"{}\"><td class=\"thumb\">{}</td><th scope=\"row\">{}</th><td>{}</td>", status,
                    one.picture.empty()
                        ? Markup{}
                        : html("<img src=\"{}\" alt=\"\" loading=\"lazy\">", data_address("image/png", one.picture)),
                    link_to(one), status);
  for (const char* key : keys) {
    const Measure& what = measure(key);
    const auto value = what.value(one.source);
    const bool none = !value || (std::string_view(key) == "seconds" && *value == 0);
    row += html("<td class=\"number\" data-value=\"{}\">{}</td>", none ? "" : fmt::format("{:.9g}", *value),
                none ? "–" : what.text(*value));
  }
  return row += html("</tr>\n");
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
  return text.empty() ? Markup{}
                      : html(
                            "<p class=\"more\">Pictures of one label share one scale of stress, up to the largest 99th "
                            "percentile among them: {}. What is above has the last colour.</p>\n",
                            text);
}

Markup table(const std::vector<CaseReport>& cases, const std::string& tsv) {
  Markup heads = html(
      "<th scope=\"col\"><span class=\"hidden\">Picture</span></th><th scope=\"col\">Case</th><th "
      "scope=\"col\">Status</th>");
  const std::vector<const char*> keys = known_keys(cases);
  for (const char* key : keys) {
    const Measure& what = measure(key);
    heads += html("<th scope=\"col\" title=\"{}\">{}{}</th>", what.description, what.title,
                  what.unit.empty() ? Markup{} : html(" <small>{}</small>", what.unit));
  }
  Markup rows;
  for (const CaseReport& one : cases) {
    rows += row_of(one, keys);
  }
  Markup made = heading(2, "Cases");
  made += html(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Table of the cases\"><table "
      "class=\"cohort sortable\"><caption class=\"hidden\">Cases and their measures</caption><thead><tr>{}</tr></thead>"
      "<tbody>\n{}</tbody></table></div>\n",
      heads, rows);
  made += scale_note(cases);
  return made += html("<p class=\"more\"><a download=\"cohort.tsv\" href=\"{}\">The whole table as TSV</a></p>\n",
                      data_address("text/tab-separated-values", tsv));
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
      items += html("<li>{}: {} {} {} (robust z {})</li>\n", link_to(*cases[outlier.index]), what.title,
                    what.text(*values[outlier.index]), what.unit, fmt::format("{:+.1f}", outlier.z));
    }
  }
  if (cases.size() < fewest_compared) {
    return html("<p>Too few cases to tell outliers.</p>\n");
  }
  Markup made = items.text.empty() ? html("<p>No outlier.</p>\n") : html("<ul class=\"outliers\">\n{}</ul>\n", items);
  return made += html("<div class=\"strips\">\n{}</div>\n", strips);
}

Markup spread(const std::vector<CaseReport>& cases) {
  std::map<std::string, CaseGroup> organs;
  for (const CaseReport& one : cases) {
    if (one.source.done()) {
      organs[one.organ_kind].push_back(&one);
    }
  }
  Markup made = heading(2, "Spread and outliers");
  made += html(
      "<p>An outlier is farther from the median than 3.5 robust standard deviations (by the median absolute "
      "deviation, taken as 1 % of the median at least), among at least five cases of a label that are done. Volumes "
      "whose file names come back from folder to folder are compared name by name.</p>\n");
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
