#include "tunica/report/detail/command_words.hpp"
#include "tunica/report/detail/measures.hpp"
#include "tunica/report/detail/sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;

// Columns of the page's table: fewer than the file's.
constexpr std::array shown_keys{"volume_ml",
                                "shells",
                                "distance_percent",
                                "min_angle_deg",
                                "stress_p99_kpa",
                                "strain_p99_percent",
                                "max_displacement_mm",
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
    const std::string next = next_command(one);
    items += html("<li>{}: {}{}: {}{}</li>\n", link_to(one),
                  one.source.stage == "none" ? "not begun" : one.source.stage, told_exit(one.source),
                  one.redacted(one.source.message), next.empty() ? Markup{} : html("<br>Next: <code>{}</code>", next));
  }
  return items.text.empty() ? Markup{} : heading(2, "Failures") += html("<ul class=\"failures\">\n{}</ul>\n", items);
}

Markup row_of(const CaseReport& one) {
  const std::string status = status_of(one);
  Markup row = html("<tr class=\"{}\"><td class=\"thumb\">{}</td><th scope=\"row\">{}</th><td>{}</td>", status,
                    one.picture.empty()
                        ? Markup{}
                        : html("<img src=\"{}\" alt=\"\" loading=\"lazy\">", data_address("image/png", one.picture)),
                    link_to(one), status);
  for (const char* key : shown_keys) {
    const Measure& what = measure(key);
    const auto value = what.value(one.source);
    const bool none = !value || (std::string_view(key) == "seconds" && *value == 0);
    row += html("<td class=\"number\" data-value=\"{}\">{}</td>", none ? "" : fmt::format("{:.9g}", *value),
                none ? "–" : what.text(*value));
  }
  return row += html("</tr>\n");
}

Markup table(const std::vector<CaseReport>& cases, const std::string& tsv) {
  Markup heads = html(
      "<th scope=\"col\"><span class=\"hidden\">Picture</span></th><th scope=\"col\">Case</th><th "
      "scope=\"col\">Status</th>");
  for (const char* key : shown_keys) {
    const Measure& what = measure(key);
    heads += html("<th scope=\"col\" title=\"{}\">{}{}</th>", what.description, what.title,
                  what.unit.empty() ? Markup{} : html(" <small>{}</small>", what.unit));
  }
  Markup rows;
  for (const CaseReport& one : cases) {
    rows += row_of(one);
  }
  Markup made = heading(2, "Cases");
  made += html(
      "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Table of the cases\"><table "
      "class=\"cohort sortable\"><caption class=\"hidden\">Cases and their measures</caption><thead><tr>{}</tr></thead>"
      "<tbody>\n{}</tbody></table></div>\n",
      heads, rows);
  return made += html("<p class=\"more\"><a download=\"cohort.tsv\" href=\"{}\">The whole table as TSV</a></p>\n",
                      data_address("text/tab-separated-values", tsv));
}

using CaseGroup = std::vector<const CaseReport*>;

// The label that was extracted as the command names it; empty: at an isovalue, or not known.
std::string label_of(const CaseReport& one) {
  return one.redacted(flag_value(words_of(one.source, "extract"), "--label").value_or(""));
}

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

fs::path volume_of(const CaseReport& one) {
  const std::vector<ReportedFile> inputs = one.source.files("extract", "inputs");
  return inputs.empty() ? fs::path() : inputs.front().path;
}

// One organ is compared with its like: cases of a label by themselves. A file name that comes back in other folders, as
// in TotalSegmentator's patient/segmentations/aorta.nii.gz, says which organ its label is.
Markup spread(const std::vector<CaseReport>& cases) {
  std::map<fs::path, std::set<fs::path>> folders_of;
  for (const CaseReport& one : cases) {
    const fs::path volume = volume_of(one);
    folders_of[volume.filename()].insert(volume.parent_path().lexically_normal());
  }
  std::map<std::array<std::string, 2>, CaseGroup> organs;
  for (const CaseReport& one : cases) {
    if (one.source.done()) {
      const fs::path file = volume_of(one).filename();
      organs[{label_of(one), folders_of[file].size() > 1 ? file.string() : ""}].push_back(&one);
    }
  }
  Markup made = heading(2, "Spread and outliers");
  made += html(
      "<p>An outlier is farther from the median than 3.5 robust standard deviations (by the median absolute "
      "deviation, taken as 1 % of the median at least), among at least five cases of a label that are done. Volumes "
      "whose file names come back from folder to folder are compared name by name.</p>\n");
  for (const auto& [organ, group] : organs) {
    if (organs.size() > 1) {
      const auto& [label, file] = organ;
      made += heading(3, (label.empty() ? "No label" : "Label " + label) +
                             (file.empty() ? "" : " of " + group.front()->redacted(file)));
    }
    made += spread_of(group);
  }
  return made;
}

}  // namespace

Markup cohort_section(const std::vector<CaseReport>& cases, const std::string& tsv) {
  Markup made = counts(cases);
  made += failures(cases);
  made += table(cases, tsv);
  made += spread(cases);
  return made;
}

std::string cohort_tsv(const std::vector<CaseReport>& cases) {
  std::string text = "case\tstatus\tstage\texit\tmessage\twarnings";
  for (const Measure& what : measures()) {
    text += "\t" + what.key;
  }
  text += "\n";
  for (const CaseReport& one : cases) {
    for (const std::string& field :
         {one.name, status_of(one), one.source.stage, one.source.exit, one.redacted(one.source.message)}) {
      text += (field.empty() ? "n/a" : in_one_line(field)) + "\t";
    }
    text += std::to_string(one.warnings.size());
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
  for (const Measure& what : measures()) {
    columns[what.key] = column(what.description, what.unit, what.source);
  }
  return columns.dump(2) + "\n";
}

}  // namespace tunica::report
