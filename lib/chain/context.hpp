#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/core/version.hpp"
#include "tunica/core/warning.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace tunica::chain {

/// Whom a stage tells how it goes, and what it writes by. Functions that are left as they are tell nobody. Who wants a
/// stage to stop calls request_stop(): it then throws Interrupted.
struct Context {
  /// The callback for a long work, such as "relax".
  std::function<Progress(const std::string& doing)> progress = [](const std::string&) { return Progress(); };
  /// A part of the work begins; it lasts as long as what is returned.
  std::function<std::shared_ptr<void>(const std::string& name)> stage = [](const std::string&) { return nullptr; };
  std::function<void(const std::string&)> note = [](const std::string&) {};    ///< a line on what came out
  std::function<void(const std::string&)> detail = [](const std::string&) {};  ///< one for who wants to know more
  std::function<void(const Warning&)> warn = [](const Warning&) {};

  /// A file is about to be read; all that were have been read; one is going to be written, under a name with one of the
  /// endings; one was written whose name nobody gave.
  std::function<void(const std::filesystem::path&)> reads = [](const std::filesystem::path&) {};
  std::function<void()> has_read = [] {};
  std::function<void(const std::filesystem::path&, const std::vector<std::string>& endings)> writes =
      [](const std::filesystem::path&, const std::vector<std::string>&) {};
  std::function<void(const std::filesystem::path&)> wrote = [](const std::filesystem::path&) {};
  /// How a file is called in what is written.
  std::function<std::string(const std::filesystem::path&)> name_of = [](const auto& path) {
    return path.filename().string();
  };
  /// The command of the run as outputs have it, and a text without what they are not to name.
  std::function<std::string()> command = [] { return std::string(); };
  std::function<std::string(const std::string&)> redact = [](const std::string& text) { return text; };
  /// What made a file, as it says itself.
  std::function<std::string()> made_by = [] { return std::string("tunica ") + version; };
  bool overwrite = false;  ///< files that exist
};

}  // namespace tunica::chain
