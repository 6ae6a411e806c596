#pragma once

#include "tunica/core/error.hpp"

#include <concepts>
#include <limits>
#include <source_location>
#include <utility>

namespace tunica {

/// An integer as another type of integer. Errors: InternalError with the caller's place when it does not hold the
/// value.
template <std::integral To, std::integral From>
constexpr To narrow(From value, std::source_location at = std::source_location::current()) {
  if (!std::in_range<To>(value)) {
    assertion_failed("a number fits its type", at.file_name(), static_cast<int>(at.line()));
  }
  return static_cast<To>(value);
}

/// A number without its fraction. Errors: as narrow(), also for nan.
template <std::integral To>
constexpr To truncated(double value, std::source_location at = std::source_location::current()) {
  // The limits of 64 bits are no doubles: the upper one is the next power of two, which is.
  constexpr double end = 2.0 * static_cast<double>(std::numeric_limits<To>::max() / 2 + 1);
  constexpr double least = static_cast<double>(std::numeric_limits<To>::min());
  if (!(value > least - 1 && value < end)) {
    assertion_failed("a number fits its type", at.file_name(), static_cast<int>(at.line()));
  }
  return static_cast<To>(value);
}

/// A count or a place as a number: exact up to 2^53.
constexpr double real(std::integral auto count) { return static_cast<double>(count); }

}  // namespace tunica
