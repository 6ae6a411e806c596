#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/io/result/pipeline_folder.hpp"

#include <string>
#include <vector>

namespace tunica::report {

/// A warning of a stage.
struct ToldWarning {
  std::string stage;
  Warning warning;  ///< its kind is empty in reports of tools from before warnings had kinds
};

/// The warnings of all stages, the heaviest first.
std::vector<ToldWarning> told_warnings(const PipelineCase& one);

/// What the stages say that is no warning, "STAGE: text".
std::vector<std::string> told_notes(const PipelineCase& one);

/// How often each kind is there, as "thick wall (2); coarse shells (1)"; the heaviest first.
std::string kinds_in_one_line(const std::vector<ToldWarning>& warnings);

/// A kind of warning over a cohort.
struct WarningKind {
  std::string kind;
  Weight weight = Weight::minor;   ///< the heaviest of them
  std::vector<std::size_t> cases;  ///< that have it, as indices
  ToldWarning example;             ///< of the first of these
};

/// The kinds of all cases: the heavy ones first, among them those of most cases. @param warnings  of each case
std::vector<WarningKind> kinds_of(const std::vector<std::vector<ToldWarning>>& warnings);

/// What a kind is called.
std::string shown_kind(const std::string& kind);

}  // namespace tunica::report
