#include "tunica/core/require.hpp"

#include "tunica/core/error.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tunica {

void require_positive(double value, std::string_view what) {
  if (!std::isfinite(value) || value <= 0) {
    throw InputError(fmt::format("{} is {}: it must be finite and above zero", what, value));
  }
}

void require_not_negative(double value, std::string_view what) {
  if (!std::isfinite(value) || value < 0) {
    throw InputError(fmt::format("{} is {}: it must be finite and not below zero", what, value));
  }
}

}  // namespace tunica
