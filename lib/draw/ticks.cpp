#include "tunica/draw/detail/ticks.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {

double round_step(double low, double high, int count) {
  TUNICA_ASSERT(count > 0);
  const double rough = high / count - low / count;
  if (!(rough > 0) || !std::isfinite(rough)) {
    return 0;
  }
  const double power = std::pow(10, std::floor(std::log10(rough)));
  if (power == 0) {
    return 0;  // the range is below the smallest normal number
  }
  for (const double factor : {1.0, 2.0, 2.5, 5.0}) {
    if (factor * power >= rough * (1 - 1e-9)) {
      return factor * power;
    }
  }
  return 10 * power;
}

std::vector<double> multiples(double low, double high, double step) {
  if (!(step > 0)) {
    return {low};
  }
  constexpr double slack = 1e-6;
  constexpr std::size_t most = 1000;
  const double first = std::ceil(low / step - slack);
  const double last = std::floor(high / step + slack);
  std::vector<double> values;
  for (double i = first; i <= last && values.size() < most; ++i) {
    values.push_back(i == 0 ? 0 : i * step);
  }
  return values;
}

std::vector<double> round_ticks(double low, double high, int count) {
  return multiples(low, high, round_step(low, high, count));
}

double round_below(double value) {
  TUNICA_ASSERT(value > 0 && std::isfinite(value));
  const double power = std::pow(10, std::floor(std::log10(value)));
  double best = power;
  for (const double factor : {2.0, 5.0, 10.0}) {
    if (factor * power <= value * (1 + 1e-9)) {
      best = factor * power;
    }
  }
  return best;
}

std::string tick_text(double tick, double step) {
  if (tick == 0 && (step < 1e-6 || step > 1)) {
    return "0";
  }
  if (!(step > 0) || !std::isfinite(step)) {
    return short_number(tick);
  }
  int decimals = 0;
  for (double scaled = step; decimals < 7 && std::abs(scaled - std::round(scaled)) > 1e-6 * scaled; scaled *= 10) {
    ++decimals;
  }
  if (decimals < 7 && std::abs(tick) < 1e6) {
    return fmt::format("{:.{}f}", tick, decimals);
  }
  // As many digits as tell the tick from its neighbours; of a step like 2.5e-06 both of its own.
  const double mantissa = step / std::pow(10, std::floor(std::log10(step)));
  const int own = std::abs(mantissa - std::round(mantissa)) > 1e-6 ? 2 : 1;
  const int digits = own + truncated<int>(std::ceil(std::log10(std::max(1.0, std::abs(tick) / step))));
  return fmt::format("{:.{}g}", tick, std::min(digits, 17));
}

std::string short_number(double value) {
  if (value == 0) {
    return "0";
  }
  const double size = std::abs(value);
  if (size >= 1000 && size < 1e6) {
    return fmt::format("{:.0f}", value);
  }
  return fmt::format("{:.3g}", value);
}

}  // namespace tunica
