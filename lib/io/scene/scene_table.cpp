#include "tunica/io/scene/detail/scene_table.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {

SceneTable::SceneTable(const toml::table& table, const std::string& file, std::string name, Keys known)
    : table_(table), file_(file), name_(std::move(name)) {
  for (const auto& [key, value] : table) {
    const Place place = at(key.source());
    Place& of_value = places_.keys.emplace(std::string(key.str()), at(value.source())).first->second;
    of_value.typed = value.value_exact<std::string>().value_or("");
    if (std::find(known.begin(), known.end(), key.str()) == known.end()) {
      place.fail(fmt::format("unknown key '{}' in {}: {}", key.str(), name_, suggestion(key.str(), known)));
    }
  }
  places_.item = at(table.source());
}

const toml::node& SceneTable::required(std::string_view key, std::string_view why) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) {
    places_.item.fail(fmt::format("{} has no '{}'{}: add it", name_, key, why));
  }
  return *node;
}

void SceneTable::fail_choice(std::string_view key, const std::string& word,
                             const std::vector<std::string_view>& words) const {
  place(key).fail(fmt::format("{} = \"{}\" in {} is not known: {}", key, word, name_, suggestion(word, words)));
}

double SceneTable::part(std::string_view key) const {
  const toml::node& node = required(key);
  if (!node.is_string()) {
    return number_of(node, key);
  }
  try {
    return parse_percent(text(key));
  } catch (const UsageError& error) {
    place(key).fail(fmt::format("{}: {}", key, error.what()));
  }
}

bool SceneTable::flag(std::string_view key) const {
  const auto value = required(key).value_exact<bool>();
  if (!value) {
    place(key).fail(fmt::format("{} must be true or false", key));
  }
  return *value;
}

std::size_t SceneTable::count(std::string_view key, std::int64_t most) const {
  const auto value = required(key).value_exact<std::int64_t>();
  if (!value || *value < 1 || *value > most) {
    place(key).fail(fmt::format("{} must be a whole number from 1 to {}", key, most));
  }
  return narrow<std::size_t>(*value);
}

const toml::array& SceneTable::array(std::string_view key, std::string_view like) const {
  const toml::array* values = required(key).as_array();
  if (values == nullptr) {
    place(key).fail(fmt::format("{} must be a list, for example {}", key, like));
  }
  return *values;
}

Vec3 SceneTable::vector_of(const toml::node& node, std::string_view key, Dimension dimension,
                           std::string_view like) const {
  const toml::array* values = node.as_array();
  if (values == nullptr || values->size() != 3) {
    at(node.source()).fail(fmt::format("{} must be a list of three quantities, for example {}", key, like));
  }
  Vec3 result;
  for (std::size_t i = 0; i < 3; ++i) {
    result[i] = quantity_of((*values)[i], key, dimension);
  }
  return result;
}

double SceneTable::quantity_of(const toml::node& node, std::string_view key, Dimension dimension) const {
  const auto text = node.value_exact<std::string>();
  try {
    if (!text && (node.is_integer() || node.is_floating_point())) {
      // The message of a bare number, which shows the right spelling.
      return parse_quantity(fmt::format("{}", node.value<double>().value_or(0)), dimension);
    }
    if (!text) {
      at(node.source()).fail(fmt::format("{} must be a text with a number and a unit", key));
    }
    return parse_quantity(*text, dimension);
  } catch (const UsageError& error) {
    at(node.source()).fail(fmt::format("{}: {}", key, error.what()));
  }
}

double SceneTable::number_of(const toml::node& node, std::string_view key) const {
  const auto value = node.value<double>();
  if (!value || !(node.is_integer() || node.is_floating_point()) || !std::isfinite(*value)) {
    at(node.source()).fail(fmt::format("{} must be a finite number without a unit", key));
  }
  return *value;
}

std::string SceneTable::text_of(const toml::node& node, std::string_view key) const {
  const auto value = node.value_exact<std::string>();
  if (!value) {
    at(node.source()).fail(fmt::format("{} must be a text in quotes", key));
  }
  if (value->find('\0') != std::string::npos) {
    at(node.source()).fail(fmt::format("{} holds a zero byte", key));
  }
  return *value;
}

const toml::table& SceneTable::table(std::string_view key, std::string_view like) const {
  const toml::table* inner = required(key).as_table();
  if (inner == nullptr) {
    place(key).fail(fmt::format("{} must be a table, for example {}", key, like));
  }
  return *inner;
}

Place SceneTable::at(const toml::source_region& region) const {
  return {fmt::format("{}:{}:{}", file_, region.begin.line, region.begin.column)};
}

}  // namespace tunica
