// draw: charts and pictures, as text and bytes; no file is touched.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tunica {

enum class Scale {
  automatic,  ///< logarithmic when nothing is negative and the positive values span more than one decade
  linear,
  logarithmic,  ///< zeros stand in a lane of their own beside the axis; negative values are left out
};

struct ChartAxis {
  std::string label;
  Scale scale = Scale::automatic;
  bool more_is_better = false;  ///< for the Pareto front
  bool is_ranked = true;        ///< less (or more) is better: a cost or an error, not a count or a parameter
};

struct ChartMark {
  double x = 0;
  double y = 0;
  std::string name;   ///< shown when the pointer rests on the mark: which run it is
  std::string label;  ///< empty, or drawn beside the mark where there is room
};

/// A run without an answer: a hollow mark on the rim, at the worse end of y, and of x too where it has no x.
struct ChartFailure {
  std::optional<double> x;
  std::string name;   ///< shown when the pointer rests on the mark
  std::string label;  ///< drawn beside the mark where there is room: its exit code
};

struct ChartSeries {
  std::string name;  ///< empty: not in the legend
  std::vector<ChartMark> marks;
  bool joined = false;  ///< a line joins the marks in their order
  std::vector<ChartFailure> failures = {};
};

/// A grey line to read the marks by.
struct ChartGuide {
  std::optional<double> y;  ///< a level of y; none: the diagonal y = x
  std::string label;        ///< in the legend
};

struct Chart {
  std::string title;
  ChartAxis x;
  ChartAxis y;
  std::string series_title;  ///< heading of the legend
  std::vector<ChartSeries> series;
  std::optional<ChartGuide> guide;
  bool of_one_problem = true;  ///< its runs may be better or worse than each other: then it has a Pareto front
};

/// For each mark of each series whether it is on the Pareto front: no other mark is better in one coordinate and at
/// least as good in the other; none where an axis is not ranked, or the runs are of several problems. Errors:
/// InputError: a mark that is not finite. Cost: n log n.
std::vector<std::vector<bool>> pareto_front(const Chart& chart);

/// The scale that an automatic axis gets for these values.
Scale resolved_scale(Scale wanted, const std::vector<double>& values);

/// Draws a chart as SVG: round ticks, light grid, marks that differ in colour and shape (colour-blind-safe), the Pareto
/// front, where both axes are ranked, as a dashed staircase, a legend below. As wide as a column of text: readable at
/// 380 pixels, too. Text in the reader's own sans-serif font, as wide as in the font of pictures; UTF-8.
/// @param chart  finite values (else InputError); a chart without marks gives empty axes
/// Limits: beyond 40 series the legend ends with "and … more".
std::string chart_svg(const Chart& chart);

}  // namespace tunica
