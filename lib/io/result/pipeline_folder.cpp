#include "tunica/io/result/pipeline_folder.hpp"

#include "tunica/core/error.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/file/report_file.hpp"

#include <algorithm>
#include <optional>
#include <sstream>

namespace tunica {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_log_bytes = std::size_t{1} << 20;
constexpr std::size_t most_record_bytes = std::size_t{64} << 20;

fs::path report_of(const fs::path& folder, const std::string& stage) { return folder / (stage + ".json"); }

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

std::string last_line(const fs::path& path) {
  std::string last;
  try {
    std::istringstream text(read_file(path, most_log_bytes));
    for (std::string line; std::getline(text, line);) {
      last = line.find_first_not_of(" \t\r") == std::string::npos ? last : line;
    }
  } catch (const InputError&) {
    return {};
  }
  return last;
}

// The reports up to the last stage of the case.
void read_reports_of(PipelineCase& one) {
  const auto last = std::ranges::find(pipeline_stages, one.stage);
  if (one.folder.empty() || last == pipeline_stages.end()) {
    return;
  }
  for (const auto* stage = pipeline_stages.begin(); stage <= last; ++stage) {
    const fs::path path = report_of(one.folder, *stage);
    if (is_there(path)) {
      try {
        one.reports[*stage] = read_report(path).json;
      } catch (const InputError& error) {
        one.unreadable.emplace_back(error.what());
      }
    }
  }
}

// Why a stage failed: what its report says, or else the last line of its log.
std::string reason_of(const PipelineCase& one) {
  const Json error = one.at(one.stage, "error");
  const std::string reason =
      error.is_string() ? error.get<std::string>() : last_line(one.folder / (one.stage + ".log"));
  const bool began = one.reports.contains(one.stage) || !one.unreadable.empty();
  return !reason.empty() ? reason : began ? "no message" : "no report: the tool was killed, or RUN did not start it";
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields(1);
  for (const char sign : line) {
    if (sign == '\t') {
      fields.emplace_back();
    } else {
      fields.back() += sign;
    }
  }
  return fields;
}

std::optional<std::vector<PipelineCase>> read_record(const fs::path& folder) {
  const fs::path path = folder / ".cases";
  if (!is_there(path)) {
    return std::nullopt;
  }
  std::vector<PipelineCase> cases;
  std::istringstream text(read_file(path, most_record_bytes));
  for (std::string line; std::getline(text, line);) {
    const std::vector<std::string> fields = fields_of(line);
    const fs::path within = fields.size() > 1 ? fs::path(fields[1]).lexically_normal() : fs::path();
    if (fields.size() != 5 || within.is_absolute() || (!within.empty() && *within.begin() == "..")) {
      throw InputError(path.string() + ": is not what Makefile.pipeline writes: remove it, and all cases are taken");
    }
    cases.push_back(
        {fields[0], within.empty() ? fs::path() : folder / within, fields[2], fields[3], fields[4], {}, {}});
  }
  return cases;
}

// Of a folder without a record: the last stage that left a report.
std::optional<PipelineCase> case_in(const fs::path& folder, const std::string& name) {
  PipelineCase one{name, folder, {}, {}, {}, {}, {}};
  for (const char* stage : pipeline_stages) {
    one.stage = is_there(report_of(folder, stage)) ? stage : one.stage;
  }
  if (one.stage.empty()) {
    return std::nullopt;
  }
  read_reports_of(one);
  const Json ok = one.at(one.stage, "ok");
  if (ok == true) {
    one.exit = "0";
    one.message = one.stage == pipeline_stages.back() ? "done" : "stopped before the next stage";
  } else if (!ok.is_boolean()) {
    one.message = one.unreadable.empty() ? "no message" : one.unreadable.back();
  }
  return one;
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_directory(unknown) && !entry->path().filename().native().starts_with(".run")) {
      found.push_back(entry->path());
    }
  }
  std::ranges::sort(found);
  return found;
}

std::vector<PipelineCase> find_cases(const fs::path& folder) {
  if (auto own = case_in(folder, name_of_case_folder(folder))) {
    return {*own};
  }
  std::vector<PipelineCase> cases;
  for (const fs::path& volume : folders_in(folder)) {
    if (auto direct = case_in(volume, volume.filename().string())) {
      cases.push_back(std::move(*direct));
    }
    for (const fs::path& label : folders_in(volume)) {
      if (auto one = case_in(label, (volume.filename() / label.filename()).string())) {
        cases.push_back(std::move(*one));
      }
    }
  }
  return cases;
}

}  // namespace

Json PipelineCase::at(const std::string& stage_name, const std::string& key) const {
  const auto report = reports.find(stage_name);
  if (report == reports.end()) {
    return nullptr;
  }
  const Json* value = &report->second;
  std::istringstream parts(key);
  for (std::string part; std::getline(parts, part, '.');) {
    if (!value->is_object() || !value->contains(part)) {
      return nullptr;
    }
    value = &value->at(part);
  }
  return *value;
}

std::vector<ReportedFile> PipelineCase::files(const std::string& stage_name, const std::string& kind) const {
  const Json entries = at(stage_name, kind);
  std::vector<ReportedFile> found;
  for (const Json& entry : entries.is_array() ? entries : Json::array()) {
    const auto text = [&](const char* key) {
      const bool told = entry.is_object() && entry.contains(key) && entry[key].is_string();
      return told ? entry[key].get<std::string>() : std::string();
    };
    found.push_back({text("path"), text("sha256")});
  }
  return found;
}

std::string name_of_case_folder(const fs::path& folder) {
  const fs::path place = (fs::absolute(folder) / "").lexically_normal().parent_path();
  return (place.parent_path().filename() / place.filename()).string();
}

std::vector<PipelineCase> read_pipeline_folder(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw InputError(folder.string() +
                     ": is not a folder: give the OUT of Makefile.pipeline, or a case's folder in it");
  }
  auto recorded = read_record(folder);
  std::vector<PipelineCase> cases = recorded ? std::move(*recorded) : find_cases(folder);
  for (PipelineCase& one : cases) {
    if (recorded) {
      read_reports_of(one);
      if (one.done() && !one.reports.contains(one.stage)) {
        if (one.unreadable.empty()) {
          one.unreadable.push_back(report_of(one.folder, one.stage).string() + ": is missing");
        }
        one.message = one.unreadable.back();
      }
    }
    one.message = one.message.empty() ? reason_of(one) : one.message;
  }
  if (cases.empty()) {
    throw InputError(folder.string() +
                     ": holds no case, a folder with extract.json, decimate.json, relax.json or simulate.json");
  }
  return cases;
}

}  // namespace tunica
