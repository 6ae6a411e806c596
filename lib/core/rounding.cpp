#include "tunica/core/rounding.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {

bool is_unit(const Vec3& vector) {
  constexpr double rounding = 1e-9;
  return std::abs(vector.norm() - 1) < rounding;
}

double rounded_upwards(double value, int digits) {
  if (!std::isfinite(value) || !(value > 0)) {
    return value;
  }
  const double step = std::pow(10, std::floor(std::log10(value)) + 1 - digits);
  return std::max(value, std::ceil(value / step * (1 - 1e-12)) * step);
}

}  // namespace tunica
