// report: one page for a run or a cohort of the pipeline, and its tables.
#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/io/result/pipeline_folder.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tunica::report {

struct PageOptions {
  bool with_names = true;  ///< false: no names of folders, volumes and cases; a case is called by its number
  bool verify = false;     ///< compare the outputs with the hashes in the reports
  std::string command;     ///< that makes the page
  Progress progress;
};

/// A page, and what stands in it as tables.
struct Page {
  std::string html;                    ///< UTF-8, whole: it loads nothing
  std::string tsv;                     ///< a line per case, a column per measure
  std::string columns;                 ///< JSON: what each column means, its unit and its source
  std::vector<std::string> different;  ///< files that are not what the reports say, when `verify` was asked for
  std::size_t failed = 0;
  std::size_t warned = 0;  ///< done, with warnings
};

/// Makes the page of one case, or of several as a cohort. Failed cases come first; files that cannot be read are named
/// in the page, not an error. The same folder gives the same bytes.
/// @param cases  at least one
/// Cost: per case that of reading its meshes, its result and, twice, its volume.
/// Limits: below 25 MB up to 200 cases: surfaces and pictures are made coarser for that.
Page make_page(std::vector<PipelineCase> cases, const PageOptions& options);

/// The table that ends a run of the pipeline: case, stage reached, exit code, message, shells, certified distance,
/// stress, displacement and strain, estimated errors where they are known, number of warnings, seconds.
/// @return tab-separated, a line per case, blanks instead of control characters
std::string summary_tsv(const std::vector<PipelineCase>& cases);

/// The same for a terminal, in columns; what the heads mean, the warnings by kind, and where the results of what is
/// done lie.
std::string summary_text(const std::vector<PipelineCase>& cases);

/// Time against distance of the cases whose shells were made, as SVG; none where there are none.
std::optional<std::string> summary_chart(const std::vector<PipelineCase>& cases);

}  // namespace tunica::report
