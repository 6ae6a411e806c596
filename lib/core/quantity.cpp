#include "tunica/core/quantity.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

namespace tunica {
namespace {

struct Unit {
  std::string_view name;
  double value;  // in tonne, mm, s
  Dimension dimension;
};

// Longest names first, so that a prefix match is the longest match ("mmHg" before "mm" before "m").
constexpr double standard_gravity_water_cm = 9.80665e-5;  // 1 cmH2O = 98.0665 Pa in MPa
constexpr std::array units{
    Unit{"cmH2O", standard_gravity_water_cm, dimension::pressure},
    Unit{"mmHg", 133.322387415e-6, dimension::pressure},
    Unit{"kPa", 1e-3, dimension::pressure},
    Unit{"MPa", 1, dimension::pressure},
    Unit{"GPa", 1e3, dimension::pressure},
    Unit{"bar", 0.1, dimension::pressure},
    Unit{"min", 60, dimension::time},
    Unit{"Pa", 1e-6, dimension::pressure},
    Unit{"uN", 1e-6, dimension::force},
    Unit{"mN", 1e-3, dimension::force},
    Unit{"kN", 1e3, dimension::force},
    Unit{"um", 1e-3, dimension::length},
    Unit{"mm", 1, dimension::length},
    Unit{"cm", 10, dimension::length},
    Unit{"us", 1e-6, dimension::time},
    Unit{"ms", 1e-3, dimension::time},
    Unit{"kg", 1e-3, {1, 0, 0}},
    Unit{"N", 1, dimension::force},
    Unit{"m", 1e3, dimension::length},
    Unit{"s", 1, dimension::time},
    Unit{"g", 1e-6, {1, 0, 0}},
    Unit{"t", 1, {1, 0, 0}},
};

struct Example {
  Dimension dimension;
  std::string_view name;
  std::string_view unit;
};
constexpr std::array examples{
    Example{dimension::length, "a length", "mm"},
    Example{dimension::time, "a time", "ms"},
    Example{dimension::rate, "a rate", "/s"},
    Example{dimension::force, "a force", "N"},
    Example{dimension::moment, "a moment", "N*mm"},
    Example{dimension::force_per_length, "a force per length", "N/mm"},
    Example{dimension::pressure, "a pressure", "kPa"},
    Example{dimension::density, "a density", "kg/m3"},
    Example{dimension::acceleration, "an acceleration", "m/s2"},
    Example{dimension::number, "a plain number", ""},
};

const Example& example_of(Dimension wanted) {
  for (const Example& e : examples) {
    if (e.dimension == wanted) {
      return e;
    }
  }
  throw InternalError("a dimension without an example");
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) {
    text.remove_prefix(1);
  }
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) {
    text.remove_suffix(1);
  }
  return text;
}

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

struct ParsedUnit {
  double value = 1;
  Dimension dimension;
};

std::optional<ParsedUnit> parse_unit(std::string_view text) {
  ParsedUnit result;
  int direction = 1;
  if (!text.empty() && text.front() == '/') {
    direction = -1;
    text.remove_prefix(1);
  }
  while (true) {
    const Unit* found = nullptr;
    for (const Unit& unit : units) {
      if (text.starts_with(unit.name)) {
        found = &unit;
        break;
      }
    }
    if (found == nullptr) {
      return std::nullopt;
    }
    text.remove_prefix(found->name.size());
    if (!text.empty() && text.front() == '^') {
      text.remove_prefix(1);
    }
    int power = 1;
    if (!text.empty() && (text.front() == '-' || (text.front() >= '0' && text.front() <= '9'))) {
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), power);
      if (error != std::errc{} || power == 0 || power < -9 || power > 9) {
        return std::nullopt;
      }
      text.remove_prefix(narrow<std::size_t>(end - text.data()));
    }
    power *= direction;
    result.value *= std::pow(found->value, power);
    result.dimension.mass += power * found->dimension.mass;
    result.dimension.length += power * found->dimension.length;
    result.dimension.time += power * found->dimension.time;
    if (text.empty()) {
      return result;
    }
    if (text.front() != '*' && text.front() != '/') {
      return std::nullopt;
    }
    direction = text.front() == '*' ? 1 : -1;
    text.remove_prefix(1);
  }
}

}  // namespace

double parse_quantity(std::string_view text, Dimension expected) {
  const Example& example = example_of(expected);
  std::string_view rest = trimmed(text);
  const auto value = take_number(rest);
  if (!value) {
    throw UsageError(
        fmt::format("'{}' is not {}: write a number and a unit, for example 2.5{}", text, example.name, example.unit));
  }
  const std::string_view number = trimmed(text).substr(0, trimmed(text).size() - rest.size());
  rest = trimmed(rest);
  if (rest.empty()) {
    if (expected == dimension::number) {
      return *value;
    }
    throw UsageError(fmt::format("'{}' has no unit: write {} with its unit, for example {}{}", text, example.name,
                                 number, example.unit));
  }
  const auto unit = parse_unit(rest);
  if (!unit) {
    throw UsageError(fmt::format("'{}' has an unknown unit '{}': {} is written like {}{}", text, rest, example.name,
                                 number, example.unit));
  }
  if (unit->dimension != expected) {
    throw UsageError(fmt::format("'{}' is not {}: write for example {}{}", text, example.name, number, example.unit));
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
  throw UsageError(fmt::format("'{}' is not a unit of length: write um, mm, cm or m", text));
}

LengthTolerance parse_length_tolerance(std::string_view text) {
  LengthTolerance result;
  if (trimmed(text).ends_with('%')) {
    result = {parse_percent(text), true};
  } else {
    std::string_view rest = trimmed(text);
    if (take_number(rest) && rest.empty()) {
      throw UsageError(
          fmt::format("'{}' has no unit: write {}% (of the diagonal) or {}mm", text, trimmed(text), trimmed(text)));
    }
    result = {parse_quantity(text, dimension::length), false};
  }
  if (!(result.value > 0)) {
    throw UsageError(fmt::format("'{}' is not a tolerance: it must be greater than zero", text));
  }
  return result;
}

double parse_percent(std::string_view text) {
  std::string_view rest = trimmed(text);
  const auto value = take_number(rest);
  if (!value || trimmed(rest) != "%") {
    throw UsageError(fmt::format("'{}' is not a percentage: write for example 5%", text));
  }
  return *value / 100;
}

std::optional<double> parse_number(std::string_view text) {
  const auto value = take_number(text);
  return value && text.empty() ? value : std::nullopt;
}

}  // namespace tunica
