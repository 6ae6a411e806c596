#include "tunica/report/detail/verify.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/report/detail/arguments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <set>

namespace tunica::report {
namespace {

namespace fs = std::filesystem;
using Strings = std::vector<std::string>;

const PipelineStage& stage_named(std::string_view name) {
  return *std::ranges::find(pipeline_chain, name, &PipelineStage::name);
}

// SHA-256 of a file; empty where it is missing or cannot be read.
std::string content_of(const fs::path& path) {
  try {
    return sha256_of_file(path);
  } catch (const InputError&) {
    return {};
  }
}

// The contents of all files of a folder.
std::set<std::string> contents_of(const fs::path& folder) {
  std::set<std::string> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_regular_file(unknown)) {
      found.insert(content_of(entry->path()));
    }
  }
  return found;
}

bool names_files(const PipelineCase& one, const std::string& stage) {
  return !arguments_of(one, stage).contains("--no-paths");
}

std::string report_file(const PipelineCase& one, const std::string& stage) {
  return (one.folder / (stage + ".json")).string();
}

// The outputs of a stage whose files are not what its report says.
void compare_outputs(const PipelineCase& one, const std::string& stage, Strings& found) {
  std::optional<std::set<std::string>> contents;  // where names are left out
  std::optional<fs::path> folder;                 // of the case when the first file, the stage's product, was written
  for (const ReportedFile& file : one.files(stage, "outputs")) {
    if (file.path.empty() || file.sha256.empty()) {
      found.push_back(report_file(one, stage) +
                      ": tells no hashes of the outputs: it is of an older version, run the stage again");
      break;
    }
    if (!names_files(one, stage)) {
      contents = contents ? contents : contents_of(one.folder);
      if (!contents->contains(file.sha256)) {
        found.push_back(report_file(one, stage) + ": no file beside it is the " + file.path.filename().string() +
                        " that " + stage + " wrote, whose name --no-paths left out");
      }
      continue;
    }
    // A file of the case lies where the case lies now; a user's own flag may have named another place.
    folder = folder.value_or(file.path.parent_path());
    const fs::path path = file.path.parent_path() == *folder ? one.folder / file.path.filename() : file.path;
    const std::string content = content_of(path);
    if (content.empty()) {
      found.push_back(path.string() + ": that " + stage + " wrote, is missing or cannot be read");
    } else if (content != file.sha256) {
      found.push_back(path.string() + ": is not what " + stage + " wrote");
    }
  }
}

// Whether a stage wrote its files in what is another case's folder now: the two were exchanged.
void compare_folder(const PipelineCase& one, const std::string& stage, const CaseFolders& all, Strings& found) {
  const auto outputs = one.files(stage, "outputs");
  if (outputs.empty() || !names_files(one, stage) || outputs.front().path.parent_path().empty()) {
    return;
  }
  const std::string before = name_of_case_folder(outputs.front().path.parent_path());
  if (before != name_of_case_folder(one.folder) && all.contains(before)) {
    found.push_back(
        fmt::format("{}: {} wrote it for {}: the folders of cases were exchanged, or files copied from one to "
                    "the other; run the case again",
                    report_file(one, stage), stage, before));
  }
}

// Whether a stage read what the stages before it wrote: a chain may be mixed from the files of two cases or of two
// runs.
std::string another_run(const PipelineCase& one, const std::string& stage, const std::string& before) {
  return fmt::format("{}: {} read another {} than {} wrote: the files are of two runs, run the case again",
                     report_file(one, stage), stage, *stage_named(before).files.begin(), before);
}

void compare_inputs(const PipelineCase& one, const std::string& stage, Strings& found) {
  const auto inputs = one.files(stage, "inputs");
  const auto hashed = [](const ReportedFile& file) { return !file.sha256.empty(); };
  if (std::ranges::none_of(inputs, hashed)) {
    return;  // none were read, or the report tells no hashes
  }
  for (const char* before : stage_named(stage).reads) {
    const auto outputs = one.files(before, "outputs");
    if (!outputs.empty() && hashed(outputs.front()) &&
        std::ranges::find(inputs, outputs.front().sha256, &ReportedFile::sha256) == inputs.end()) {
      found.push_back(another_run(one, stage, before));
    }
  }
  // What a stage may read besides, such as the surface that its shells were fitted to.
  for (const char* before : pipeline_stages) {
    const auto outputs = one.files(before, "outputs");
    if (before != stage && !outputs.empty() && hashed(outputs.front()) &&
        std::ranges::any_of(inputs, [&](const ReportedFile& file) {
          return hashed(file) && !file.path.empty() && file.path == outputs.front().path &&
                 file.sha256 != outputs.front().sha256;
        })) {
      found.push_back(another_run(one, stage, before));
    }
  }
}

// A report that an earlier run left, which is not read, may tell of files.
bool has_unread_report(const PipelineCase& one, const std::string& stage) {
  std::error_code error;
  return !one.reports.contains(stage) && fs::exists(report_file(one, stage), error);
}

// Files of the pipeline's names that no report tells of.
void find_unclaimed(const PipelineCase& one, const std::string& stage, Strings& found) {
  std::error_code error;
  if (has_unread_report(one, stage)) {
    return;
  }
  const auto outputs = one.files(stage, "outputs");
  for (const char* name : stage_named(stage).files) {
    const fs::path path = one.folder / name;
    const auto tells = [&](const ReportedFile& file) {
      return file.sha256.empty() || file.path.filename() == name ||
             (!names_files(one, stage) && content_of(path) == file.sha256);
    };
    if (fs::is_regular_file(path, error) && std::ranges::none_of(outputs, tells)) {
      found.push_back(path.string() + ": no report of " + stage + " tells what it wrote");
    }
  }
}

// Whether a file of a case's folder is no product: what is hidden, which the pipeline keeps for itself, logs, pages,
// reports, and what a tool that was stopped left half-written.
bool is_no_product(const fs::path& file) {
  const std::string name = file.filename().string();
  const std::string stem = file.stem().string();
  return name.starts_with('.') || name.find(".part") != std::string::npos || file.extension() == ".log" ||
         file.extension() == ".html" ||
         (file.extension() == ".json" && std::ranges::find(pipeline_stages, stem) != pipeline_stages.end());
}

// Files of other names that no report tells of, be it as an output or as an input.
void find_strangers(const PipelineCase& one, Strings& found) {
  if (std::ranges::any_of(pipeline_stages, [&](const char* stage) { return has_unread_report(one, stage); })) {
    return;
  }
  std::set<fs::path> known;
  std::set<std::string> contents;  // where names are left out
  for (const auto& [stage, files, reads] : pipeline_chain) {
    known.insert(files.begin(), files.end());
    for (const char* side : {"outputs", "inputs"}) {
      for (const ReportedFile& file : one.files(stage, side)) {
        known.insert(file.path.filename());
        contents.insert(names_files(one, stage) ? std::string() : file.sha256);
      }
    }
  }
  std::set<fs::path> there;
  std::error_code error;
  for (fs::directory_iterator entry(one.folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_regular_file(unknown) && !is_no_product(entry->path()) && !known.contains(entry->path().filename())) {
      there.insert(entry->path());
    }
  }
  for (const fs::path& path : there) {
    if (!contents.contains(content_of(path))) {
      found.push_back(path.string() + ": no report tells of it: move it out of the case's folder");
    }
  }
}

}  // namespace

CaseFolders folders_of(const std::vector<PipelineCase>& cases) {
  CaseFolders folders;
  for (const PipelineCase& one : cases) {
    if (!one.folder.empty()) {  // one that was refused has none
      folders.insert(name_of_case_folder(one.folder));
    }
  }
  return folders;
}

Strings differences(const PipelineCase& one, const CaseFolders& all) {
  Strings found;
  if (one.folder.empty()) {  // it was refused before any file was made
    return found;
  }
  for (const char* stage : pipeline_stages) {
    find_unclaimed(one, stage, found);
    compare_outputs(one, stage, found);
    compare_inputs(one, stage, found);
    compare_folder(one, stage, all, found);
  }
  find_strangers(one, found);
  return found;
}

}  // namespace tunica::report
