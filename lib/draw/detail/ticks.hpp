#pragma once

#include <string>
#include <vector>

/// Round numbers for the scales of charts and colour bars.
namespace tunica {

/// The smallest of 1, 2, 2.5, 5 times a power of ten that divides [low, high] into at most `count` parts.
/// @return 0 when high <= low.
double round_step(double low, double high, int count);

/// The multiples of `step` within [low, high], to rounding; only `low` when the step is 0.
std::vector<double> multiples(double low, double high, double step);

/// The multiples of round_step() within [low, high], to rounding; only `low` when high <= low.
std::vector<double> round_ticks(double low, double high, int count);

/// The largest of 1, 2, 5 times a power of ten that is not above `value` > 0.
double round_below(double value);

/// A tick with the decimals that its step needs: "0.05" beside "0.10"; below 1e-6 and from 1e6 on as "2e-07".
std::string tick_text(double tick, double step);

/// A number with three significant digits, without needless zeros: "0.42", "1230", "3.1e-07".
std::string short_number(double value);

}  // namespace tunica
