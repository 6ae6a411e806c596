#pragma once

#include "tunica/report/detail/case_report.hpp"
#include "tunica/report/detail/html.hpp"
#include "tunica/report/detail/measures.hpp"

#include <string>
#include <vector>

namespace tunica::report {

/// What is said of one case: verdict, three numbers, the organ, slices, tables, files, commands, methods.
/// @param level  of its headings, 2 or 3
/// @param paths  whether files are named with their folders
Markup case_section(const CaseReport& one, int level, bool paths);

/// Counts, failures, table, outliers and strips of a cohort; the cases follow.
/// @param cases  the failed ones first
/// @param tsv    the table as a file, for a link
Markup cohort_section(const std::vector<CaseReport>& cases, const std::string& tsv);

/// A paragraph on how the numbers were made, to paste into a paper, with its references.
Markup methods_section(const CaseReport& one, int level);

/// A command that helps further with a failed case, and what for.
struct NextStep {
  std::string what;  ///< "Next"
  std::string command;
};

/// The likeliest first; none where no stage was run.
std::vector<NextStep> next_steps(const CaseReport& one);

/// Why an accuracy was not reached.
std::string why_inaccurate(const CaseReport& one);

/// How a failed stage ended, ", exit code N"; empty where no code tells of a failure.
std::string told_exit(const PipelineCase& one);

/// The table of a cohort, tab-separated; "n/a" where a value is not known.
std::string cohort_tsv(const std::vector<CaseReport>& cases);

/// JSON: of each of its columns Description, Units and Source.
std::string cohort_columns();

/// One case per mark, on a line from the smallest value to the largest. @return inline SVG
struct StripMark {
  double value = 0;
  std::string name;
  bool outlier = false;
};
Markup strip_plot(const Measure& what, const std::vector<StripMark>& marks);

}  // namespace tunica::report
