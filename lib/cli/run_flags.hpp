#pragma once

#include "tunica/chain/simulate.hpp"
#include "tunica/cli/tool.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tunica::cli {

/// Which files a run reads and writes, and how its result is drawn.
struct RunFlags {
  std::vector<std::filesystem::path> files;
  std::filesystem::path scene, resume;  ///< empty: not given
  std::optional<std::string> tessellation;
  std::vector<std::string> exports;
  std::optional<std::filesystem::path> unloaded;
  bool check = false;

  static constexpr const char* resume_flag = "--resume";

  /// Its files and where its scene is; then, in a second part, what is done with it.
  void declare_files(Tool& tool);
  void declare_run(Tool& tool);

  /// Which file is written; empty where --check needs none. Errors: UsageError: too few or too many files, or flags of
  /// a scene beside one.
  [[nodiscard]] std::filesystem::path output(const CLI::App& app) const;

  /// @param before  of a run that goes on: it draws as it began where nothing else is said. Errors: UsageError.
  [[nodiscard]] chain::Drawing drawing(const RunIdentity* before) const;
};

}  // namespace tunica::cli
