#include "tunica/report/report.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/version.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/report/detail/command_words.hpp"
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
    // The label that was extracted as the command names it; empty: at an isovalue, or not known.
    const std::string label = flag_value(words_of(one.source, "extract"), "--label").value_or("");
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

Markup policy() {
  return html(
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src &#39;none&#39;; script-src "
      "&#39;sha256-{}&#39;; style-src &#39;sha256-{}&#39;; img-src data:; base-uri &#39;none&#39;; form-action "
      "&#39;none&#39;\">\n",
      sha256_base64(embedded::report_js()), sha256_base64(embedded::report_css()));
}

Markup head(const std::string& title) {
  Markup made = html("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n");
  made += policy();
  made += html(
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" "
      "content=\"light dark\">\n<meta name=\"referrer\" content=\"no-referrer\">\n<meta name=\"generator\" "
      "content=\"tunica {}\">\n<title>{} – tunica report</title>\n",
      version, title);
  made += {"<style>" + std::string(embedded::report_css()) + "</style>\n</head>\n"};
  return made;
}

Markup footer(const std::string& command) {
  Markup made = html(
      "<footer>\n<p><strong>Not a medical device.</strong> For research only. The wall is linear elastic and as thick "
      "as "
      "stated; without a pressure at which it was taken the image shows it unloaded.</p>\n<p>Made by "
      "tunica {} (GPL-3.0-or-later)",
      version);
  made += command.empty() ? html(".</p>\n") : html(": <code>{}</code></p>\n", command);
  made += html(
      "<details><summary>Licences of what this page carries</summary><pre "
      "tabindex=\"0\">{}</pre></details>\n</footer>\n",
      embedded::LICENCES_txt());
  return made;
}

Markup body(const std::vector<CaseReport>& cases, const std::string& tsv, const std::string& command, bool paths) {
  Markup made;
  if (cases.size() == 1) {
    made += html("<body>\n<header><p class=\"brand\">tunica report</p><h1><bdi>{}</bdi></h1></header>\n<main>\n",
                 cases[0].name);
    made += case_section(cases[0], 2, paths);
  } else {
    made +=
        html("<body class=\"many\">\n<header><p class=\"brand\">tunica report</p><h1>{} cases</h1></header>\n<main>\n",
             cases.size());
    made += cohort_section(cases, tsv);
    made += heading(2, "Case by case");
    for (const CaseReport& one : cases) {
      made += html("<details class=\"case {}\" id=\"{}\"><summary><bdi>{}</bdi></summary>\n", status_of(one), one.id(),
                   one.name);
      made += case_section(one, 3, paths);
      made += html("</details>\n");
    }
  }
  made += html("</main>\n");
  made += footer(command);
  made += {"<script>" + std::string(embedded::report_js()) + "</script>\n</body>\n</html>\n"};
  return made;
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
  Markup whole = head(reports.size() == 1 ? reports[0].name : fmt::format("{} cases", reports.size()));
  whole += body(reports, page.tsv, command, options.with_names);
  page.html = std::move(whole.text);
  return page;
}

}  // namespace tunica::report
