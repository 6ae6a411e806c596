#pragma once

#include "tunica/draw/chart.hpp"

#include <string>

/// What stands below the axes of a chart.
namespace tunica {

struct Legend {
  std::string svg;
  double bottom = 0;  ///< pixels: where it ends
};

/// The chart's series in as many columns as fit, and what its lines are; long names are broken, not cut.
/// @param top  pixels: base line of the first row
Legend chart_legend(const Chart& chart, double top);

/// Whether a front means something: both axes are ranked.
bool has_front(const Chart& chart);
bool has_failures(const Chart& chart);

}  // namespace tunica
