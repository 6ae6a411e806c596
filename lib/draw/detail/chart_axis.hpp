#pragma once

#include "tunica/draw/chart.hpp"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

/// From values to an axis with round ticks.
namespace tunica {

struct Tick {
  double value = 0;
  std::string text;      ///< empty: a small tick without text
  std::string exponent;  ///< after the text, raised
};

struct DrawnAxis {
  bool logarithmic = false;
  bool zeros = false;  ///< a lane for zeros at the low end of a logarithmic axis
  double low = 0;
  double high = 1;
  std::vector<Tick> ticks;

  static constexpr double lane = 0.07;

  /// 0 at the low end, 1 at the high end; none for a value that this axis cannot show.
  [[nodiscard]] std::optional<double> place(double value) const {
    if (!logarithmic) {
      // Halves: high - low may overflow.
      return (value / 2 - low / 2) / (high / 2 - low / 2);
    }
    const double start = zeros ? lane : 0;
    if (value > 0) {
      return start + (1 - start) * (std::log10(value) - std::log10(low)) / (std::log10(high) - std::log10(low));
    }
    return value == 0 && zeros ? std::optional(lane / 2) : std::nullopt;
  }
};

/// An axis that shows all values, but for the negative ones where it is logarithmic.
DrawnAxis make_axis(Scale wanted, const std::vector<double>& values);

}  // namespace tunica
