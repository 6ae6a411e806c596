#include "tunica/core/quantity.hpp"

#include "tunica/core/detail/units.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/spelling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tunica {
namespace {

// The number at the front of text, which is shortened by it. Not "inf", "nan" or hexadecimal.
std::optional<double> take_number(std::string_view& text) {
  std::string_view rest = text;
  if (!rest.empty() && rest.front() == '+') {
    rest.remove_prefix(1);
    if (!rest.empty() && rest.front() == '-') {
      return std::nullopt;
    }
  }
  const std::size_t sign = !rest.empty() && rest.front() == '-' ? 1 : 0;
  if (rest.size() <= sign || !(rest[sign] == '.' || (rest[sign] >= '0' && rest[sign] <= '9'))) {
    return std::nullopt;
  }
  double value = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (error != std::errc{} || !std::isfinite(value)) {
    return std::nullopt;
  }
  text = rest.substr(narrow<std::size_t>(end - rest.data()));
  return value;
}

const Usage& required_usage(Dimension wanted) {
  const Usage* const usage = usage_of(wanted);
  TUNICA_ASSERT(usage != nullptr);
  return *usage;
}

std::string_view example_unit(const Usage& usage) { return usage.units.substr(0, usage.units.find(' ')); }

// How to write it: what was meant, where that can be told, or else the units there are.
[[noreturn]] void refuse(std::string_view text, const std::string& why, std::string_view number, const Usage& usage) {
  std::string way = advice(right_spellings(text, usage.dimension));
  if (way.empty()) {
    std::string names(usage.units);
    for (std::size_t at = names.find(' '); at != std::string::npos; at = names.find(' ', at + 2)) {
      names.replace(at, 1, ", ");
    }
    way = usage.units.empty() ? fmt::format("write {} alone", number)
                              : fmt::format("units of {} are {}, for example 2.5{}",
                                            usage.name.substr(usage.name.find(' ') + 1), names, example_unit(usage));
  }
  throw UsageError(fmt::format("'{}' {}: {}", text, why, way));
}

// Errors: UsageError where the number goes on with what people group or end it with elsewhere: "1,5mm", "1 000kPa".
void require_point(std::string_view text, std::string_view rest, const Usage& usage) {
  if (rest.find_first_of(",.'0123456789") != 0) {
    return;
  }
  std::vector<std::string> right = right_spellings(text, usage.dimension);
  if (right.empty()) {
    // The number alone: "1,5" has no unit either.
    right = right_numbers(text);
    std::ranges::for_each(right, [&](std::string& spelling) {
      spelling.insert(std::min(spelling.find(' '), spelling.size()), example_unit(usage));
    });
  }
  if (!right.empty()) {
    throw UsageError(fmt::format("'{}' is not written with a decimal point alone: {}", text, advice(right)));
  }
}

}  // namespace

double parse_quantity(std::string_view text, Dimension expected) {
  const Usage& usage = required_usage(expected);
  std::string_view rest = trimmed_quantity(text);
  const auto value = take_number(rest);
  if (!value) {
    const std::string way = advice(right_spellings(text, expected));
    throw UsageError(fmt::format(
        "'{}' is not {}: {}", text, usage.name,
        way.empty() ? fmt::format("write a number and a unit, for example 2.5{}", example_unit(usage)) : way));
  }
  const std::string_view whole = trimmed_quantity(text);
  const std::string_view number = whole.substr(0, whole.size() - rest.size());
  rest = trimmed_quantity(rest);
  if (rest.empty()) {
    if (expected == dimension::number) {
      return *value;
    }
    throw UsageError(fmt::format("'{}' has no unit: write {} with its unit, for example {}{}", text, usage.name, number,
                                 example_unit(usage)));
  }
  const auto unit = parse_unit(rest);
  if (!unit) {
    require_point(text, rest, usage);
    refuse(text, fmt::format("has an unknown unit '{}'", rest), number, usage);
  }
  if (unit->dimension != expected) {
    const Usage* const other = usage_of(unit->dimension);
    refuse(
        text,
        other == nullptr ? fmt::format("is not {}", usage.name) : fmt::format("is {}, not {}", other->name, usage.name),
        number, usage);
  }
  const double result = *value * unit->value;
  // Beyond this bound conversions to SI and products of a few quantities would overflow.
  constexpr double largest = 1e60;
  if (!(std::abs(result) <= largest)) {
    throw UsageError(fmt::format("'{}' is too large", text));
  }
  return result;
}

double parse_length_unit(std::string_view text) {
  for (const std::string_view name : {"um", "mm", "cm", "m"}) {
    if (text == name) {
      return parse_quantity(fmt::format("1{}", name), dimension::length);
    }
  }
  const std::vector<std::string> near = right_spellings(fmt::format("1{}", text), dimension::length);
  throw UsageError(fmt::format("'{}' is not a unit of length: write {}", text,
                               near.size() == 1 ? near.front().substr(1) : "um, mm, cm or m"));
}

LengthTolerance parse_length_tolerance(std::string_view text) {
  LengthTolerance result;
  if (trimmed_quantity(text).ends_with('%')) {
    result = {parse_percent(text), true};
  } else {
    std::string_view rest = trimmed_quantity(text);
    if (take_number(rest) && rest.empty()) {
      throw UsageError(fmt::format("'{}' has no unit: write {}% (of the diagonal) or {}mm", text,
                                   trimmed_quantity(text), trimmed_quantity(text)));
    }
    result = {parse_quantity(text, dimension::length), false};
  }
  if (!(result.value > 0)) {
    throw UsageError(fmt::format("'{}' is not a tolerance: it must be greater than zero", text));
  }
  return result;
}

double parse_percent(std::string_view text) {
  std::string_view rest = trimmed_quantity(text);
  const auto value = take_number(rest);
  if (!value || trimmed_quantity(rest) != "%") {
    std::vector<std::string> right =
        trimmed_quantity(text).ends_with('%')
            ? right_numbers(trimmed_quantity(text).substr(0, trimmed_quantity(text).size() - 1))
            : std::vector<std::string>{};
    std::ranges::for_each(right,
                          [](std::string& number) { number.insert(std::min(number.find(' '), number.size()), "%"); });
    throw UsageError(
        fmt::format("'{}' is not a percentage: {}", text, right.empty() ? "write for example 5%" : advice(right)));
  }
  return *value / 100;
}

std::string percent_text(double part) {
  constexpr double two_digits = 0.995;
  return std::abs(part) < two_digits ? fmt::format("{:.2g} %", 100 * part) : fmt::format("{:.0f} %", 100 * part);
}

std::optional<double> parse_number(std::string_view text) {
  const auto value = take_number(text);
  return value && text.empty() ? value : std::nullopt;
}

}  // namespace tunica
