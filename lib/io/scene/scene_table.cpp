#include "tunica/io/scene/detail/scene_table.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

Place place_in(const SceneSource& source, const toml::source_region& region) {
  return {fmt::format("{}:{}:{}", source.file, region.begin.line, region.begin.column)};
}

}  // namespace

SceneTable::SceneTable(const toml::table& table, SceneSource& source, std::string name,
                       std::span<const std::string_view> known)
    : table_(table), source_(source), name_(std::move(name)) {
  for (const auto& [key, value] : table) {
    Place& of_value = places_.keys.emplace(std::string(key.str()), at(value)).first->second;
    of_value.typed = value.value_exact<std::string>().value_or("");
    if (std::ranges::find(known, key.str()) == known.end()) {
      place_in(source, key.source())
          .fail(fmt::format("unknown key '{}' in {}: {}", key.str(), name_, suggestion(key.str(), known)));
    }
  }
  places_.item = at(table);
}

const toml::node& SceneTable::required(std::string_view key, std::string_view why) const {
  const toml::node* node = table_.get(key);
  if (node == nullptr) {
    places_.item.fail(fmt::format("{} has no '{}'{}: add it", name_, key, why));
  }
  return *node;
}

Place SceneTable::at(const toml::node& node) const { return place_in(source_, node.source()); }

}  // namespace tunica
