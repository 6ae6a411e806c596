#include "tunica/core/narrow.hpp"
#include "tunica/io/file/suggestion.hpp"
#include "tunica/io/scene/detail/scene_key.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <numbers>

namespace tunica {

void Range::require(double value, const Place& place, std::string_view key) const {
  if (!contains(value)) {
    place.fail(fmt::format(fmt::runtime(otherwise), fmt::arg("key", key), fmt::arg("value", value)));
  }
}

std::string Range::text() const {
  return high == infinity ? fmt::format("{} {}", with_low ? "from" : "above", low)
                          : fmt::format("in {}{}, {}{}", with_low ? '[' : '(', low, high, with_high ? ']' : ')');
}

namespace form {
namespace {

namespace fs = std::filesystem;

double read_number(const SceneTable& table, const toml::node& node, std::string_view key) {
  const auto value = node.value<double>();
  if (!value || !(node.is_integer() || node.is_floating_point()) || !std::isfinite(*value)) {
    table.at(node).fail(fmt::format("{} must be a finite number without a unit", key));
  }
  return *value;
}

std::string read_text(const SceneTable& table, const toml::node& node, std::string_view key) {
  const auto value = node.value_exact<std::string>();
  if (!value) {
    table.at(node).fail(fmt::format("{} must be a text in quotes", key));
  }
  if (value->find('\0') != std::string::npos) {
    table.at(node).fail(fmt::format("{} holds a zero byte", key));
  }
  return *value;
}

/// What `parse` makes of a text. Errors: what it throws, at the place of the text.
template <typename Parse>
auto parsed(const SceneTable& table, const toml::node& node, std::string_view key, const Parse& parse) {
  const std::string text = read_text(table, node, key);
  try {
    return parse(text);
  } catch (const UsageError& error) {
    table.at(node).fail(fmt::format("{}: {}", key, error.what()));
  }
}

double read_quantity(const SceneTable& table, const toml::node& node, std::string_view key, Dimension dimension) {
  const auto text = node.value_exact<std::string>();
  try {
    if (!text && (node.is_integer() || node.is_floating_point())) {
      // The message of a bare number, which shows the right spelling.
      return parse_quantity(fmt::format("{}", node.value<double>().value_or(0)), dimension);
    }
    if (!text) {
      table.at(node).fail(fmt::format("{} must be a text with a number and a unit", key));
    }
    return parse_quantity(*text, dimension);
  } catch (const UsageError& error) {
    table.at(node).fail(fmt::format("{}: {}", key, error.what()));
  }
}

/// The shortest decimal that reads as the same double again. Where no decimal does (a conversion skips some doubles),
/// that of the nearest value that has one.
/// @param text_with  the value with so many digits; read  what that is read as
template <typename TextWith, typename Read>
std::string shortest(double value, const TextWith& text_with, const Read& read) {
  for (int attempt = 0; attempt < 2; ++attempt) {
    for (int digits = 1; digits <= 17; ++digits) {
      const std::string text = text_with(value, digits);
      if (read(text) == value) {
        return text;
      }
    }
    value = read(text_with(value, 17));
  }
  return text_with(value, 17);
}

std::string quantity_text(double value, std::string_view unit, Dimension dimension) {
  const double size = parse_quantity(fmt::format("1{}", unit), dimension);
  return shortest(
      value, [&](double wanted, int digits) { return fmt::format("{:.{}g}{}", wanted / size, digits, unit); },
      [&](const std::string& text) { return parse_quantity(text, dimension); });
}

/// A TOML float: "1" alone would be an integer, which reads the same but says less.
std::string number_text(double value) {
  std::string text = fmt::format("{}", value);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

/// A path as the file may say it; absolute where it leaves the file's folder, for a link on the way up leads elsewhere.
std::string path_text(const fs::path& path, const Writing& to) {
  const fs::path whole = fs::absolute(path).lexically_normal();
  const fs::path within = to.folder.empty() ? to.folder : whole.lexically_relative(to.folder);
  return within.empty() || *within.begin() == ".." ? whole.string() : within.string();
}

/// Pairs of a time and a value, at least one, times increasing; in a static run the load factor plays the part of time.
template <typename Value>
std::vector<std::pair<double, Value>> read_pairs(const SceneTable& table, const toml::node& list, std::string_view key,
                                                 std::string_view like_first, const Form<Value>& value) {
  Scene& scene = table.source().scene;
  const bool over_time = Writing{&scene}.over_time();
  const std::string like = fmt::format(R"([[{}, {}], [{}, {}]])", over_time ? R"("0s")" : "0.0", like_first,
                                       over_time ? R"("1s")" : "1.0", value.like);
  std::vector<std::pair<double, Value>> pairs;
  for (const toml::node& node : array_of(table, list, key, 0, "a list", like)) {
    const toml::array* pair = node.as_array();
    if (pair == nullptr || pair->size() != 2) {
      table.at(node).fail(fmt::format("{} must be a list of pairs, for example {}", key, like));
    }
    const toml::node& when = (*pair)[0];
    const bool load_factor = !over_time && (when.is_integer() || when.is_floating_point());
    const double time = load_factor ? read_number(table, when, key) : read_quantity(table, when, key, dimension::time);
    if (!over_time && !load_factor && pairs.empty()) {
      scene.warnings.push_back(
          {Weight::note, "time in a static run",
           fmt::format("{}: a static run has no time: the {} is read over the load factor, 1s as factor 1",
                       table.at(list).text, key)});
    }
    if (!pairs.empty() && !(time > pairs.back().first)) {
      table.at(when).fail(fmt::format("the times of {} must increase", key));
    }
    pairs.emplace_back(time, value.read(table, (*pair)[1], key));
  }
  if (pairs.empty()) {
    table.at(list).fail(fmt::format("{} is empty: write for example {}", key, like));
  }
  return pairs;
}

template <typename Value>
std::string pairs_text(const std::vector<std::pair<double, Value>>& points, const Form<Value>& value,
                       const Writing& to) {
  std::vector<std::string> pairs;
  for (const auto& [time, at] : points) {
    const std::string when = to.over_time() ? in_quotes(quantity_text(time, "s", dimension::time)) : number_text(time);
    pairs.push_back(fmt::format("[{}, {}]", when, value.write(at, to)));
  }
  return fmt::format("[{}]", fmt::join(pairs, ", "));
}

template <typename Value>
Form<Table<Value>> table_over_time(const Form<Value>& value) {
  return {value.like + " or a table",
          [value](const SceneTable& table, const toml::node& node, std::string_view key) -> Table<Value> {
            const toml::array* entries = node.as_array();
            if (entries == nullptr || (!entries->empty() && !entries->front().is_array())) {
              return {{{0, value.read(table, node, key)}}};
            }
            return {read_pairs(table, node, key, value.like, value)};
          },
          [value](const Table<Value>& table, const Writing& to) {
            const bool constant = table.points.size() == 1 && table.points.front().first == 0;
            return constant ? value.write(table.points.front().second, to) : pairs_text(table.points, value, to);
          }};
}

}  // namespace

std::string in_quotes(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (code < 0x20 || code == 0x7f) {
      result += fmt::format("\\u{:04X}", code);
    } else {
      result += c;
    }
  }
  return result + "\"";
}

std::string braced(const std::vector<std::string>& lines) { return fmt::format("{{{}}}", fmt::join(lines, ", ")); }

const toml::table& table_of(const SceneTable& table, const toml::node& node, std::string_view key,
                            std::string_view like) {
  const toml::table* inner = node.as_table();
  if (inner == nullptr) {
    table.at(node).fail(fmt::format("{} must be a table, for example {}", key, like));
  }
  return *inner;
}

const toml::array& array_of(const SceneTable& table, const toml::node& node, std::string_view key, std::size_t count,
                            std::string_view what, std::string_view like) {
  const toml::array* values = node.as_array();
  if (values == nullptr || (count != 0 && values->size() != count)) {
    table.at(node).fail(fmt::format("{} must be {}, for example {}", key, what, like));
  }
  return *values;
}

std::size_t number_of_word(const SceneTable& table, const toml::node& node, std::string_view key,
                           const std::vector<std::string_view>& words) {
  const std::string word = read_text(table, node, key);
  const auto found = std::ranges::find(words, word);
  if (found == words.end()) {
    table.at(node).fail(
        fmt::format("{} = \"{}\" in {} is not known: {}", key, word, table.name(), suggestion(word, words)));
  }
  return narrow<std::size_t>(found - words.begin());
}

Form<std::string> text(std::string_view like) {
  return {std::string(like), read_text, [](const std::string& text, const Writing&) { return in_quotes(text); }};
}

Form<fs::path> file(std::string_view like) {
  return {std::string(like),
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            return table.source().folder / read_text(table, node, key);
          },
          [](const fs::path& path, const Writing& to) { return in_quotes(path_text(path, to)); }};
}

Form<double> number(std::string_view like) {
  return {std::string(like), read_number, [](double value, const Writing&) { return number_text(value); }};
}

Form<double> part(std::string_view like) {
  return {std::string(like),
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            return node.is_string() ? parsed(table, node, key, parse_percent) : read_number(table, node, key);
          },
          [](double value, const Writing&) { return number_text(value); }};
}

Form<bool> flag() {
  return {"true",
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            const auto value = node.value_exact<bool>();
            if (!value) {
              table.at(node).fail(fmt::format("{} must be true or false", key));
            }
            return *value;
          },
          [](bool value, const Writing&) -> std::string { return value ? "true" : "false"; }};
}

Form<std::size_t> count(std::int64_t most) {
  return {"3",
          [most](const SceneTable& table, const toml::node& node, std::string_view key) {
            const auto value = node.value_exact<std::int64_t>();
            if (!value || *value < 1 || *value > most) {
              table.at(node).fail(fmt::format("{} must be a whole number from 1 to {}", key, most));
            }
            return narrow<std::size_t>(*value);
          },
          [](std::size_t value, const Writing&) { return std::to_string(value); }};
}

Form<double> quantity(Dimension dimension, std::string_view unit, std::string_view like) {
  return {std::string(like),
          [=](const SceneTable& table, const toml::node& node, std::string_view key) {
            return read_quantity(table, node, key, dimension);
          },
          [=](double value, const Writing&) { return in_quotes(quantity_text(value, unit, dimension)); }};
}

Form<double> angle(std::string_view like) {
  const auto radians = [](double degrees) { return degrees * std::numbers::pi / 180; };
  const auto text = [](double angle, int digits) {
    return fmt::format("{:.{}g}", angle * 180 / std::numbers::pi, digits);
  };
  const auto degrees = [](const std::string& written) { return parse_number(written).value_or(0); };
  return made_of(number(like), radians, [=](double angle) {
    return degrees(shortest(angle, text, [=](const std::string& written) { return radians(degrees(written)); }));
  });
}

Form<Vec3> vector(Dimension dimension, std::string_view unit, std::string_view like) {
  return made_of(
      list_of(quantity(dimension, unit, ""), 3, "a list of three quantities", like),
      [](const std::vector<double>& v) { return Vec3(v[0], v[1], v[2]); },
      [](const Vec3& v) {
        return std::vector{v.x(), v.y(), v.z()};
      });
}

Form<Vec3> direction() {
  const auto some = [](const std::vector<double>& v, const Place& place, std::string_view key) {
    place.require(v[0] != 0 || v[1] != 0 || v[2] != 0, fmt::format("{} is zero and has no direction", key));
  };
  return made_of(
      list_of(number(""), 3, "a list of three numbers", "[0.0, 0.0, 1.0]").checked(some),
      [](const std::vector<double>& v) {
        const Vec3 direction(v[0], v[1], v[2]);
        // What is unit stays as it is, to the last bit: a scene that was written is read as it was.
        return std::abs(direction.squaredNorm() - 1) > 4e-15 ? Vec3(direction.stableNormalized()) : direction;
      },
      [](const Vec3& v) {
        return std::vector{v.x(), v.y(), v.z()};
      });
}

Form<double> unit_of_length() {
  return {R"("mm" | "cm" | "m" | "um")",
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            return parsed(table, node, key, parse_length_unit);
          },
          [](double mm, const Writing&) {
            return in_quotes(mm == 1 ? "mm" : mm == 10 ? "cm" : mm == 1000 ? "m" : "um");
          }};
}

Form<LengthTolerance> length_tolerance(std::string_view like) {
  return {std::string(like),
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            return parsed(table, node, key, parse_length_tolerance);
          },
          [](const LengthTolerance& tolerance, const Writing&) {
            return in_quotes(tolerance.relative ? number_text(1e2 * tolerance.value) + "%"
                                                : quantity_text(tolerance.value, "m", dimension::length));
          }};
}

Form<std::array<bool, 3>> axes() {
  static constexpr std::string_view names = "xyz";
  return {"\"xyz\"",
          [](const SceneTable& table, const toml::node& node, std::string_view key) {
            const std::string text = read_text(table, node, key);
            std::array<bool, 3> held{false, false, false};
            for (const char c : text) {
              const std::size_t axis = names.find(c);
              if (axis == std::string_view::npos || held[axis]) {
                table.at(node).fail(fmt::format(
                    "{} = \"{}\" must name each held axis once: \"xyz\", \"z\", or \"\" for none", key, text));
              }
              held[axis] = true;
            }
            return held;
          },
          [](const std::array<bool, 3>& held, const Writing&) {
            std::string text;
            for (std::size_t axis = 0; axis < 3; ++axis) {
              text += held[axis] ? names.substr(axis, 1) : "";
            }
            return in_quotes(text);
          }};
}

Form<std::array<std::string, 2>> two_names(std::string_view like) {
  return made_of(
      list_of(text(""), 2, "the names of two bodies", like),
      [](const std::vector<std::string>& names) {
        return std::array{names[0], names[1]};
      },
      [](const std::array<std::string, 2>& names) {
        return std::vector<std::string>{names[0], names[1]};
      });
}

Form<std::vector<double>> increasing_numbers(std::string_view like) {
  Form<std::vector<double>> form = list_of(number(""), 0, "a list", like);
  form.read = [like](const SceneTable& table, const toml::node& list, std::string_view key) {
    std::vector<double> numbers{0};
    for (const toml::node& node : array_of(table, list, key, 0, "a list", like)) {
      numbers.push_back(read_number(table, node, key));
      table.at(node).require(numbers.back() > numbers.end()[-2], fmt::format("{} must increase from above 0", key));
    }
    table.at(list).require(numbers.size() > 1, fmt::format("{} is empty: write for example {}", key, like));
    return std::vector(numbers.begin() + 1, numbers.end());
  };
  return form;
}

Form<std::map<std::string, fs::path>> files_by_name(std::string_view like) {
  return {std::string(like),
          [like](const SceneTable& table, const toml::node& node, std::string_view key) {
            std::map<std::string, fs::path> files;
            for (const auto& [name, path] : table_of(table, node, key, like)) {
              files[std::string(name.str())] = table.source().folder / read_text(table, path, key);
            }
            return files;
          },
          [](const std::map<std::string, fs::path>& files, const Writing& to) {
            std::vector<std::string> texts;
            for (const auto& [name, path] : files) {
              texts.push_back(fmt::format("{} = {}", in_quotes(name), in_quotes(path_text(path, to))));
            }
            return braced(texts);
          }};
}

Form<Ramp> ramp() {
  const Form<double> factor = number("1.0");
  return {R"([["0s", 0.0], ["1s", 1.0]])",
          [factor](const SceneTable& table, const toml::node& node, std::string_view key) {
            return Ramp{read_pairs(table, node, key, "0.0", factor)};
          },
          [factor](const Ramp& ramp, const Writing& to) { return pairs_text(ramp.points, factor, to); }};
}

Form<Table<double>> over_time(const Form<double>& value) { return table_over_time(value); }
Form<Table<Vec3>> over_time(const Form<Vec3>& value) { return table_over_time(value); }

}  // namespace form
}  // namespace tunica
