#pragma once

#include "tunica/io/result/pipeline_folder.hpp"

#include <string>
#include <utility>
#include <vector>

namespace tunica::report {

/// Takes the names of folders and files out of texts, where that is asked for (`--no-paths`).
class Redaction {
public:
  /// Leaves every text as it is.
  Redaction() = default;

  /// Knows the names that the case's reports tell: of inputs and outputs, their folders and their stems. "case N"
  /// replaces the case's own; what else looks like a path becomes "[path]".
  Redaction(const PipelineCase& one, std::size_t number);

  /// The text without them. Limits: a name in a message that is neither a path nor known from a report stays, and so
  /// does a number of up to three digits; of a case that is called as the tools call things ("empty", "mm") these words
  /// go, too, but no flags.
  [[nodiscard]] std::string operator()(std::string text) const;

private:
  void forget(const std::string& name, const std::string& instead);

  bool active_ = false;
  std::vector<std::pair<std::string, std::string>> names_;  ///< what stands instead; longer names first
};

}  // namespace tunica::report
