#include "tunica/core/rounding.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {

double rounded_upwards(double value, int digits) {
  if (!std::isfinite(value) || !(value > 0)) {
    return value;
  }
  const double step = std::pow(10, std::floor(std::log10(value)) + 1 - digits);
  return std::max(value, std::ceil(value / step * (1 - 1e-12)) * step);
}

}  // namespace tunica
