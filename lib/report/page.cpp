#include "tunica/report/report.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/report/detail/arguments.hpp"
#include "tunica/report/detail/embedded.hpp"
#include "tunica/report/detail/organ.hpp"
#include "tunica/report/detail/sections.hpp"
#include "tunica/report/detail/verify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;

fs::path volume_of(const CaseReport& one) {
  const std::vector<ReportedFile> inputs = one.source.files("extract", "inputs");
  return inputs.empty() ? fs::path() : inputs.front().path;
}

// One organ is compared with its like: cases of a label by themselves. A file name that comes back in other folders, as
// in TotalSegmentator's patient/segmentations/aorta.nii.gz, says which organ its label is.
void name_organs(std::vector<CaseReport>& cases) {
  std::map<fs::path, std::set<fs::path>> folders_of;
  for (const CaseReport& one : cases) {
    const fs::path volume = volume_of(one);
    folders_of[volume.filename()].insert(volume.parent_path().lexically_normal());
  }
  for (CaseReport& one : cases) {
    // The label that was extracted as it was named; empty: at an isovalue, or not known.
    const std::string label = argument(one.source, "extract", "--label").value_or("");
    const fs::path file = volume_of(one).filename();
    const std::string name = folders_of[file].size() > 1 ? file.string() : "";
    one.organ_kind = label + "\n" + name;
    one.organ_name = (label.empty() ? "No label" : "Label " + one.redacted(label)) +
                     (name.empty() ? "" : " of " + one.redacted(name));
  }
}

CaseReport report_of(PipelineCase source, std::size_t number, const CaseFolders& folders, const PageOptions& options) {
  CaseReport one;
  one.source = std::move(source);
  one.number = number;
  one.name = options.with_names ? one.source.name : fmt::format("case {}", number);
  one.redacted = options.with_names ? Redaction() : Redaction(one.source, number);
  one.warnings = told_warnings(one.source);
  for (ToldWarning& told : one.warnings) {
    told.warning.text = one.redacted(told.warning.text);
  }
  one.notes = told_notes(one.source);
  std::ranges::transform(one.notes, one.notes.begin(), one.redacted);
  for (const std::string& unreadable : one.source.unreadable) {
    one.missing.push_back(one.redacted(unreadable));
  }
  if (options.verify) {
    one.different = one.missing;
    std::ranges::transform(differences(one.source, folders), std::back_inserter(one.different), one.redacted);
  }
  return one;
}

Markup main_of(const std::vector<CaseReport>& cases, const std::string& tsv, bool paths) {
  if (cases.size() == 1) {
    return case_section(cases[0], 2, paths);
  }
  Markup made = cohort_section(cases, tsv);
  made += heading(2, "Case by case");
  for (const CaseReport& one : cases) {
    made +=
        part("case_in_cohort",
             {{"status", status_of(one)}, {"id", one.id()}, {"name", one.name}, {"case", case_section(one, 3, paths)}});
  }
  return made;
}

std::string html_of(const std::vector<CaseReport>& cases, const std::string& tsv, const std::string& command,
                    bool paths) {
  const bool many = cases.size() > 1;
  const std::string title = many ? fmt::format("{} cases", cases.size()) : cases[0].name;
  const auto as_it_is = [](std::string_view text) { return Markup{std::string(text)}; };
  return part("page", {{"script_hash", as_it_is(sha256_base64(embedded::report_js()))},
                       {"style_hash", as_it_is(sha256_base64(embedded::report_css()))},
                       {"version", version},
                       {"title", title},
                       {"style", as_it_is(embedded::report_css())},
                       {"class", as_it_is(many ? " class=\"many\"" : "")},
                       {"heading", many ? as_it_is(title) : part("name", {{"name", title}})},
                       {"main", main_of(cases, tsv, paths)},
                       {"made_by", command.empty() ? as_it_is(".") : part("command", {{"command", command}})},
                       {"licences", embedded::LICENCES_txt()},
                       {"script", as_it_is(embedded::report_js())}})
      .text;
}

}  // namespace

Page make_page(std::vector<PipelineCase> cases, const PageOptions& options) {
  TUNICA_ASSERT(!cases.empty());
  const Room room = room_for(cases.size());
  const CaseFolders folders = folders_of(cases);
  std::vector<CaseReport> reports;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    check_interrupt();
    CaseReport one = report_of(std::move(cases[i]), i + 1, folders, options);
    draw_organ(one, room);
    draw_slices(one, room);
    reports.push_back(std::move(one));
    if (options.progress) {
      options.progress(real(i + 1) / real(cases.size()));
    }
  }
  name_organs(reports);
  take_pictures(reports, room);
  std::ranges::stable_partition(reports, [](const CaseReport& one) { return !one.source.done(); });
  Page page;
  page.tsv = cohort_tsv(reports);
  page.columns = cohort_columns();
  for (const CaseReport& one : reports) {
    page.different.insert(page.different.end(), one.different.begin(), one.different.end());
    page.failed += one.source.done() ? 0 : 1;
    page.warned += status_of(one) == "warned" ? 1 : 0;
  }
  std::string command = options.command;
  if (!options.with_names) {
    command = "tunica-report --no-paths";
  }
  page.html = html_of(reports, page.tsv, command, options.with_names);
  return page;
}

}  // namespace tunica::report
