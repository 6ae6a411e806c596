#include "tunica/draw/detail/chart_axis.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/ticks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace tunica {
namespace {

std::string exponent(int power) { return fmt::format("{}{}", power < 0 ? "−" : "", std::abs(power)); }

// 1,000 and more with commas.
std::string grouped(std::string digits) {
  const std::size_t end = std::min(digits.find('.'), digits.size());
  const std::size_t begin = digits.find_first_of("0123456789");
  for (std::size_t at = end; at > begin + 3; at -= 3) {
    digits.insert(at - 3, ",");
  }
  return digits;
}

// All ticks of an axis are plain numbers, or all are powers of ten.
Tick power_tick(int factor, int power, bool plain) {
  const double value = factor * std::pow(10, power);
  if (plain) {
    return {value, grouped(fmt::format("{:.{}f}", value, std::max(0, -power))), ""};
  }
  return {value, factor == 1 ? "10" : fmt::format("{}×10", factor), exponent(power)};
}

DrawnAxis logarithmic_axis(const std::vector<double>& values) {
  DrawnAxis axis;
  axis.logarithmic = true;
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (const double value : values) {
    axis.zeros = axis.zeros || value == 0;
    if (value > 0) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  if (most == 0) {
    least = most = 1;
  }
  // A margin of 4 % of the axis, at least a tenth of a decade.
  const double margin = std::max(0.1, 0.04 * (std::log10(most) - std::log10(least)));
  const double from = std::max(std::log10(least) - margin, -307.0);
  const double to = std::min(std::log10(most) + margin, 308.0);
  axis.low = std::pow(10, from);
  axis.high = std::pow(10, to);
  if (axis.zeros) {
    axis.ticks.push_back({0, "0", ""});
  }
  const int first = truncated<int>(std::floor(from));
  const int last = truncated<int>(std::ceil(to));
  const int every = std::max(1, (last - first + 7) / 8);
  const bool close = to - from < 2.6;
  const bool plain = axis.low > 0.9e-4 && axis.high < 1.1e6;
  for (int power = first; power <= last; ++power) {
    for (int factor = 1; factor < 10; ++factor) {
      const double value = factor * std::pow(10, power);
      if (!(value >= axis.low * (1 - 1e-9)) || !(value <= axis.high * (1 + 1e-9))) {
        continue;
      }
      const bool written = factor == 1 ? power % every == 0 : close && (factor == 2 || factor == 5);
      if (written) {
        axis.ticks.push_back(power_tick(factor, power, plain));
      } else if (every == 1 || (factor == 1 && every <= 10)) {
        axis.ticks.push_back({value, "", ""});
      }
    }
  }
  return axis;
}

DrawnAxis linear_axis(const std::vector<double>& values) {
  DrawnAxis axis;
  constexpr int count = 7;
  double least = values.empty() ? 0 : *std::ranges::min_element(values);
  double most = values.empty() ? 1 : *std::ranges::max_element(values);
  if (least >= 0 && least < 0.4 * most) {
    least = 0;
  } else if (most <= 0 && most > 0.4 * least) {
    most = 0;
  }
  // Equal values, to rounding or next to zero, stand in the middle of a range of their size.
  const double narrowest = std::max(1e-12 * std::max(std::abs(least), std::abs(most)), 1e-290);
  if (!(most / 2 - least / 2 > narrowest)) {
    const double around = most == 0 ? 1 : std::max(0.1 * std::abs(most), 1e-290);
    least -= around;
    most += around;
  }
  axis.low = std::isfinite(least) ? least : -std::numeric_limits<double>::max();
  axis.high = std::isfinite(most) ? most : std::numeric_limits<double>::max();
  const double step = round_step(axis.low, axis.high, count);
  const double round_low = std::floor(axis.low / step + 1e-9) * step;
  const double round_high = std::ceil(axis.high / step - 1e-9) * step;
  if (step > 0 && std::isfinite(round_low) && std::isfinite(round_high)) {
    axis.low = round_low;
    axis.high = round_high;
  }
  const double size = std::max(std::abs(axis.low), std::abs(axis.high));
  const bool plain = size >= 1e-3 && size < 1e6;
  // All ticks with the power of the largest, with the decimals that the step needs.
  const int power = truncated<int>(std::floor(std::log10(size) + 1e-9));
  for (const double value : multiples(axis.low, axis.high, step)) {
    if (plain || value == 0) {
      axis.ticks.push_back({value, value == 0 ? "0" : grouped(tick_text(value, step)), ""});
    } else {
      const double unit = std::pow(10, power);
      axis.ticks.push_back({value, tick_text(value / unit, step / unit) + "×10", exponent(power)});
    }
  }
  return axis;
}

}  // namespace

Scale resolved_scale(Scale wanted, const std::vector<double>& values) {
  if (wanted != Scale::automatic) {
    return wanted;
  }
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (const double value : values) {
    if (value < 0) {
      return Scale::linear;
    }
    if (value > 0) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  return most / 10 > least ? Scale::logarithmic : Scale::linear;
}

DrawnAxis make_axis(Scale wanted, const std::vector<double>& values) {
  return resolved_scale(wanted, values) == Scale::logarithmic ? logarithmic_axis(values) : linear_axis(values);
}

}  // namespace tunica
