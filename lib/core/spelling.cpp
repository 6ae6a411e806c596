#include "tunica/core/spelling.hpp"

#include "tunica/core/detail/units.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace tunica {
namespace {

// What is longer was not written as a quantity.
constexpr std::size_t longest_text = 60;

bool is_digit(char sign) { return sign >= '0' && sign <= '9'; }

std::string lower(std::string_view text) {
  std::string made(text);
  std::ranges::for_each(made, [](char& sign) { sign += sign >= 'A' && sign <= 'Z' ? 'a' - 'A' : 0; });
  return made;
}

void replace_all(std::string& text, std::string_view what, std::string_view by) {
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size())) {
    text.replace(at, what.size(), by);
  }
}

// The signs that people write into quantities, by those of a keyboard.
std::string in_ascii(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 17> signs{{{"\u00b5", "u"},
                                                                                 {"\u03bc", "u"},
                                                                                 {"\u00b9", "1"},
                                                                                 {"\u00b2", "2"},
                                                                                 {"\u00b3", "3"},
                                                                                 {"\u2082", "2"},
                                                                                 {"\u207b", "-"},
                                                                                 {"\u2212", "-"},
                                                                                 {"\u2013", "-"},
                                                                                 {"\u00b7", "*"},
                                                                                 {"\u22c5", "*"},
                                                                                 {"\u00d7", "*"},
                                                                                 {"\u2019", "'"},
                                                                                 {"\u00a0", " "},
                                                                                 {"\u2009", " "},
                                                                                 {"\u202f", " "},
                                                                                 {"\t", " "}}};
  std::string made(text);
  for (const auto& [sign, instead] : signs) {
    replace_all(made, sign, instead);
  }
  return made;
}

// --------------------------------------------------------------------------------------------------------------
// numbers

struct Reading {
  std::string text;
  std::string meaning;  ///< where there are several
};

// Digits with separators as people write them, at the front of text, which is shortened by them; empty: no number.
std::string take_digits(std::string_view& text) {
  std::size_t end = !text.empty() && (text.front() == '-' || text.front() == '+') ? 1 : 0;
  const std::size_t first = end;
  while (end < text.size()) {
    const bool groups = (text[end] == ' ' || text[end] == '\'') && end > first && is_digit(text[end - 1]) &&
                        end + 1 < text.size() && is_digit(text[end + 1]);
    if (!is_digit(text[end]) && text[end] != '.' && text[end] != ',' && !groups) {
      break;
    }
    ++end;
  }
  std::string digits(text.substr(0, end));
  text.remove_prefix(end);
  return std::ranges::any_of(digits, is_digit) ? digits : "";
}

// The exponent at the front of text, which is shortened by it; empty where there is none.
std::string take_exponent(std::string_view& text) {
  std::size_t end = 1;
  if (text.empty() || (text.front() != 'e' && text.front() != 'E')) {
    return {};
  }
  end += end < text.size() && (text[end] == '-' || text[end] == '+') ? 1 : 0;
  const std::size_t first = end;
  while (end < text.size() && is_digit(text[end])) {
    ++end;
  }
  if (end == first) {
    return {};
  }
  std::string exponent(text.substr(0, end));
  text.remove_prefix(end);
  return exponent;
}

// What digits with separators may say: a point or comma that is alone is decimal, what is repeated groups thousands;
// three digits after one comma may be either.
std::vector<Reading> readings_of(std::string digits) {
  std::erase_if(digits, [](char sign) { return sign == ' ' || sign == '\'' || sign == '+'; });
  const auto commas = std::ranges::count(digits, ',');
  const auto points = std::ranges::count(digits, '.');
  const auto without = [&](char sign) {
    std::string made = digits;
    std::erase(made, sign);
    return made;
  };
  const auto decimal = [](std::string text) {
    std::ranges::replace(text, ',', '.');
    const std::size_t first = text.starts_with("-") ? 1 : 0;
    return text.compare(first, 1, ".") == 0 ? text.insert(first, "0") : text;
  };
  const auto groups_thousands = [&](char sign) {
    std::size_t at = digits.find(sign);
    while (at != std::string::npos) {
      const std::size_t next = digits.find(sign, at + 1);
      if (std::min(next, digits.size()) != at + 4) {
        return false;
      }
      at = next;
    }
    return true;
  };
  if ((commas == 0 && points > 1 && !groups_thousands('.')) || (points == 0 && commas > 1 && !groups_thousands(','))) {
    return {};
  }
  if (commas == 0) {
    return {{points > 1 ? without('.') : digits, ""}};
  }
  if (points == 0) {
    const std::size_t comma = digits.find(',');
    const std::string before = digits.substr(0, comma);
    if (commas > 1) {
      return {{without(','), ""}};
    }
    const bool groups = digits.size() == comma + 4 && !before.empty() && before != "0" && before != "-" &&
                        before != "-0" && before.size() <= 4;
    return groups ? std::vector<Reading>{{without(','), "the comma groups thousands"},
                                         {decimal(digits), "the comma is decimal"}}
                  : std::vector<Reading>{{decimal(digits), ""}};
  }
  const char last = digits[digits.find_last_of(".,")];
  if (std::ranges::count(digits, last) > 1) {
    return {};
  }
  std::string made = without(last == ',' ? '.' : ',');
  return {{decimal(made), ""}};
}

// ----------------------------------------------------------------------------------------------------------------
// units

/// A unit, or a part of one, as tunica writes it.
struct UnitReading {
  std::string text;
  double scale = 1;     ///< of the number beside it
  std::string meaning;  ///< where another prefix is as near
};

/// A prefix that tunica has no unit for, and that its case alone tells from one that it has.
struct Twin {
  std::string_view written;
  std::string_view meaning;
  std::string_view instead;
  double scale;
  std::string_view known;  ///< the meaning of the unit that tunica has
};
constexpr std::array twins{Twin{"mPa", "millipascal", "Pa", 1e-3, "megapascal"},
                           Twin{"Mbar", "megabar", "MPa", 1e5, "millibar"},
                           Twin{"MN", "meganewton", "kN", 1e3, "millinewton"}};

/// A unit that tunica does not read, in one that it does: exact, so that no other one is taken for it.
struct Foreign {
  std::string_view written;
  std::string_view instead;
  double scale;
};
constexpr std::array foreign_units{
    Foreign{"Ba", "Pa", 0.1},
    Foreign{"daPa", "Pa", 10},
    Foreign{"atm", "kPa", 101.325},
    Foreign{"mHg", "mmHg", 1e3},
    Foreign{"cmHg", "mmHg", 10},
    Foreign{"inHg", "mmHg", 25.4},
    Foreign{"mmH2O", "cmH2O", 0.1},
    Foreign{"mH2O", "cmH2O", 100},
    Foreign{"ksi", "psi", 1e3},
    Foreign{"daN", "N", 10},
    Foreign{"kgf", "N", 9.80665},
    Foreign{"gf", "mN", 9.80665},
    Foreign{"lbf", "N", 4.4482216152605},
    Foreign{"nN", "uN", 1e-3},
    Foreign{"dm", "mm", 100},
    Foreign{"nm", "um", 1e-3},
    Foreign{"km", "m", 1e3},
    Foreign{"in", "mm", 25.4},
    Foreign{"ft", "mm", 304.8},
    Foreign{"Mg", "t", 1},
    Foreign{"mg", "g", 1e-3},
    Foreign{"lb", "kg", 0.45359237},
    Foreign{"ns", "us", 1e-3},
    Foreign{"h", "min", 60},
};

// The sign of a unit that is written as a word, such as "kilopascals"; else what was written.
std::string abbreviated(const std::string& written) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 8> prefixes{{{"micro", "u"},
                                                                                   {"milli", "m"},
                                                                                   {"centi", "c"},
                                                                                   {"hecto", "h"},
                                                                                   {"kilo", "k"},
                                                                                   {"mega", "M"},
                                                                                   {"giga", "G"},
                                                                                   {"", ""}}};
  constexpr std::array<std::pair<std::string_view, std::string_view>, 15> words{{{"pascal", "Pa"},
                                                                                 {"newton", "N"},
                                                                                 {"meter", "m"},
                                                                                 {"metre", "m"},
                                                                                 {"micron", "um"},
                                                                                 {"second", "s"},
                                                                                 {"sec", "s"},
                                                                                 {"msec", "ms"},
                                                                                 {"minute", "min"},
                                                                                 {"gram", "g"},
                                                                                 {"liter", "l"},
                                                                                 {"litre", "l"},
                                                                                 {"dyne", "dyn"},
                                                                                 {"bar", "bar"},
                                                                                 {"cc", "ml"}}};
  const std::string small = lower(written);
  for (const auto& [prefix, sign] : prefixes) {
    for (const auto& [word, unit] : words) {
      const std::string whole = std::string(prefix) + std::string(word);
      if (small == whole || small == whole + "s") {
        return std::string(sign) + std::string(unit);
      }
    }
  }
  return written;
}

// The units whose names differ from what is written by their case at most.
std::vector<UnitReading> units_like(const std::string& written) {
  const auto* const foreign = std::ranges::find(foreign_units, written, &Foreign::written);
  if (foreign != foreign_units.end() && !parse_unit(written)) {
    return {{std::string(foreign->instead), foreign->scale, ""}};
  }
  const std::string small = lower(written);
  std::vector<UnitReading> found;
  for (const Unit& unit : units) {
    if (lower(unit.name) == small) {
      found.push_back({std::string(unit.name), 1, ""});
    }
  }
  for (const Twin& twin : twins) {
    if (lower(twin.written) == small && (written == small || written.front() == twin.written.front())) {
      std::ranges::for_each(found, [&](UnitReading& unit) { unit.meaning = twin.known; });
      found.push_back({std::string(twin.instead), twin.scale, std::string(twin.meaning)});
    }
  }
  return found;
}

// A unit whose parts are each put right by themselves. @param unit  without blanks
std::vector<UnitReading> readings_of_parts(const std::string& unit) {
  std::vector<UnitReading> made{{}};
  for (std::size_t at = 0; at < unit.size();) {
    const bool divides = unit[at] == '/';
    const std::string mark = divides || unit[at] == '*' ? unit.substr(at, 1) : "";
    const std::size_t begin = at + mark.size();
    at = std::min(unit.find_first_of("*/", begin), unit.size());
    std::string name = unit.substr(begin, at - begin);
    std::string power;
    std::vector<UnitReading> parts = units_like(abbreviated(name));  // "cmH2O" ends with a letter, "mm2" with a power
    if (parts.empty()) {
      power = name.substr(name.find_last_not_of("^-0123456789") + 1);
      name.resize(name.size() - power.size());
      parts = units_like(abbreviated(name));
    }
    std::vector<UnitReading> longer;
    const std::size_t digit = power.find_first_of("123456789");
    const double exponent = (divides ? -1 : 1) * (power.find('-') == std::string::npos ? 1 : -1) *
                            (digit == std::string::npos ? 1 : power[digit] - '0');
    for (const UnitReading& before : made) {
      for (const UnitReading& part : parts) {
        longer.push_back({before.text + mark + part.text + power, before.scale * std::pow(part.scale, exponent),
                          before.meaning + part.meaning});
      }
    }
    made = std::move(longer);
  }
  return made;
}

// Letters to change, add or leave out.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

// The one usual unit of the dimension that begins with what is written, or, where that is no unit, is one letter away,
// which is not the first: "mmH2O" and "ksi" are units of their own, and tunica has others than these.
std::vector<UnitReading> usual_unit_near(const std::string& unit, const Usage& usage) {
  constexpr std::size_t fewest_letters = 2;
  const std::string small = lower(unit);
  std::vector<UnitReading> longer;
  std::vector<UnitReading> nearest;
  std::string_view rest = usage.units;
  while (!rest.empty() && small.size() >= fewest_letters) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    const std::string name(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (lower(name).starts_with(small)) {
      longer.push_back({name, 1, ""});
    } else if (!parse_unit(unit) && lower(name).front() == small.front() && edits(lower(name), small) == 1) {
      nearest.push_back({name, 1, ""});
    }
  }
  return longer.size() == 1 ? longer : longer.empty() && nearest.size() == 1 ? nearest : std::vector<UnitReading>{};
}

std::vector<UnitReading> unit_readings(std::string text, const Usage& usage) {
  replace_all(text, " per ", "/");
  replace_all(text, "**", "^");
  std::erase(text, ' ');
  if (text.empty()) {
    return {};
  }
  std::vector<UnitReading> found = readings_of_parts(text);
  std::erase_if(found, [&](const UnitReading& reading) {
    const auto unit = parse_unit(reading.text);
    return !unit || unit->dimension != usage.dimension;
  });
  if (found.size() == 1) {
    found.front().meaning.clear();  // the others are of another dimension
  }
  return found.empty() ? usual_unit_near(text, usage) : found;
}

std::string scaled(const std::string& number, double scale) {
  const auto value = parse_number(number);
  return scale == 1 || !value ? number : fmt::format("{:.12g}", *value * scale);
}

}  // namespace

std::vector<std::string> right_numbers(std::string_view text) {
  if (text.size() > longest_text) {
    return {};
  }
  const std::string ascii = in_ascii(trimmed_quantity(text));
  std::string_view rest = ascii;
  const std::string digits = take_digits(rest);
  const std::string exponent = take_exponent(rest);
  std::vector<std::string> found;
  if (!digits.empty() && rest.empty()) {
    for (const Reading& number : readings_of(digits)) {
      found.push_back(number.text + exponent + (number.meaning.empty() ? "" : fmt::format(" ({})", number.meaning)));
    }
  }
  return found;
}

std::vector<std::string> right_spellings(std::string_view text, Dimension dimension) {
  const Usage* const usage = usage_of(dimension);
  if (usage == nullptr || text.size() > longest_text) {
    return {};
  }
  const std::string ascii = in_ascii(trimmed_quantity(text));
  std::string_view rest = ascii;
  const std::string digits = take_digits(rest);
  if (digits.empty()) {
    return {};
  }
  const std::string exponent = take_exponent(rest);
  std::vector<std::string> found;
  for (const Reading& number : readings_of(digits)) {
    if (!parse_number(number.text + exponent)) {
      continue;  // too large
    }
    for (const UnitReading& unit : unit_readings(std::string(rest), *usage)) {
      const std::string meaning = number.meaning.empty() || unit.meaning.empty() ? number.meaning + unit.meaning
                                                                                 : number.meaning + ", " + unit.meaning;
      found.push_back(scaled(number.text + exponent, unit.scale) + unit.text +
                      (meaning.empty() ? "" : fmt::format(" ({})", meaning)));
    }
  }
  return found;
}

std::string advice(const std::vector<std::string>& spellings) {
  return spellings.empty() ? "" : fmt::format("write {}", fmt::join(spellings, " or "));
}

}  // namespace tunica
