#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/draw/chart.hpp"
#include "tunica/io/file/report_file.hpp"

namespace tunica {

/// What a chart of reports shows. Keys are those of values_at().
struct ReportChartOptions {
  std::optional<std::string> x;       ///< none: time
  std::optional<std::string> y;       ///< none: error
  std::optional<std::string> series;  ///< marks of one value share colour, shape and legend entry; `file`: its name
  std::optional<std::string> label;   ///< drawn beside each mark; `file`: the report's file name
  std::optional<Report> reference;    ///< errors are taken against this finer run
  std::optional<std::string> failed;  ///< draw failed runs on the rim, the value of this key beside them
  std::optional<ChartGuide> guide;
  std::string title;
  std::optional<std::string> x_label;  ///< none: from the key
  std::optional<std::string> y_label;
  Scale x_scale = Scale::automatic;
  Scale y_scale = Scale::automatic;
  std::string made_by;  ///< stands in the first line of the table
  bool joined = false;  ///< join the marks of a series in the order of x; those of a list are always joined
};

struct ReportChart {
  Chart chart;
  std::string csv;    ///< the numbers behind the picture, a line per mark (RFC 4180)
  std::string x_key;  ///< what was drawn, also where it was chosen here
  std::string y_key;
  std::size_t marks = 0;
  std::size_t failures = 0;  ///< on the rim
  std::size_t on_front = 0;
  std::vector<Warning> warnings;  ///< what was left out, and why
};

/// Makes a chart of runs, one mark per run, or a line of marks where a key leads through a list.
/// Time is `result.ms_per_step.median` where all runs are simulations that have it, else the seconds of each tool's
/// algorithm alone. Error is the upper bound of the distance for decimate, relax and compare, the difference between
/// the volumes of mesh and voxels for extract, the algebraic error or else the residual for simulate, or what
/// error_against() finds. Reports of failed runs give marks on the rim: at their x where they have one, else in the
/// corner; their y is left out of the table. With `y` and `reference` the error is the relative difference of that key,
/// in percent. Errors: InputError naming the file where a key is missing or not a number, or when nothing is left to
/// draw.
ReportChart chart_of_reports(const std::vector<Report>& reports, const std::vector<Report>& failed,
                             const ReportChartOptions& options);

/// A label for an axis from a dotted key: "result.hausdorff_percent.upper" gives
/// "Hausdorff distance, upper bound (% of the diagonal)".
std::string describe_key(const std::string& key);

}  // namespace tunica
