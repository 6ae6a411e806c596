#pragma once

#include "tunica/core/json.hpp"

#include <array>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

/// What Makefile.pipeline leaves in its folder: cases, their stages and the stages' reports.
namespace tunica {

/// What a stage of Makefile.pipeline leaves in the case's folder beside its report, STAGE.json.
struct PipelineStage {
  const char* name;
  std::initializer_list<const char*> files;  ///< first the product that later stages read
  std::initializer_list<const char*> reads;  ///< stages
};

/// The stages of a case, in order; tools/pipeline.py and the rules of the Makefile have the same.
inline constexpr std::array<PipelineStage, 4> pipeline_chain{
    {{"extract", {"surface.ply"}, {}},
     {"decimate", {"coarse.ply"}, {"extract"}},
     {"relax", {"shell.ply", "map.png"}, {"extract", "decimate"}},
     {"simulate", {"result.hdf", "result.page", "picture.png", "refined.ply"}, {"relax"}}}};

/// Their names.
inline constexpr std::array<const char*, 4> pipeline_stages{pipeline_chain[0].name, pipeline_chain[1].name,
                                                            pipeline_chain[2].name, pipeline_chain[3].name};

/// A file that a report names.
struct ReportedFile {
  std::filesystem::path path;  ///< empty where the entry tells none
  std::string sha256;          ///< the same
};

/// A case: one label of one volume.
struct PipelineCase {
  std::string name;                     ///< "STEM/LABEL", any bytes
  std::filesystem::path folder;         ///< where its files lie; empty where it has none
  std::string stage;                    ///< the last that was run, or "none"
  std::string exit;                     ///< its exit code, "" where it did not end
  std::string message;                  ///< "done", or why it is not
  std::map<std::string, Json> reports;  ///< by stage, up to the last; an object each
  std::vector<std::string> unreadable;  ///< reports that are there and cannot be read, with the reason

  [[nodiscard]] bool done() const { return message == "done"; }
  /// The value behind a stage's report's dotted key; null where there is none.
  [[nodiscard]] Json at(const std::string& stage_name, const std::string& key) const;
  /// What a stage's report says that it read ("inputs") or wrote ("outputs"): one per entry, in their order.
  [[nodiscard]] std::vector<ReportedFile> files(const std::string& stage_name, const std::string& kind) const;
};

/// What a case's folder is called within OUT, such as "aorta/1": the last two parts of its path, which is not empty.
std::string name_of_case_folder(const std::filesystem::path& folder);

/// The cases of a folder, as the last run of the pipeline left word of them in FOLDER/.cases (a line per case: name,
/// folder within FOLDER, last stage, exit code, message, separated by tabs), or else all there are: folders with a
/// stage's report, at most two levels down, or FOLDER itself.
/// Reports are read up to the last stage that was run: what an earlier run left behind it does not count.
/// Errors: InputError when the folder is none, cannot be read, or holds no case.
/// Cost: the reports' bytes. Limits: a report of more than 16 MiB is unreadable.
std::vector<PipelineCase> read_pipeline_folder(const std::filesystem::path& folder);

}  // namespace tunica
