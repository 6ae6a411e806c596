#include "tunica/core/detail/units.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tunica {

const Usage* usage_of(Dimension dimension) {
  const auto* const found = std::ranges::find(usages, dimension, &Usage::dimension);
  return found == usages.end() ? nullptr : found;
}

std::string_view trimmed_quantity(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) {
    text.remove_prefix(1);
  }
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) {
    text.remove_suffix(1);
  }
  return text;
}

std::optional<ParsedUnit> parse_unit(std::string_view text) {
  ParsedUnit result;
  int direction = 1;
  if (!text.empty() && text.front() == '/') {
    direction = -1;
    text.remove_prefix(1);
  }
  while (true) {
    const auto* const found =
        std::ranges::find_if(units, [&](const Unit& unit) { return text.starts_with(unit.name); });
    if (found == units.end()) {
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

}  // namespace tunica
