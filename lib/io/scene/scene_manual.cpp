#include "tunica/io/scene/scene_manual.hpp"

#include "tunica/io/scene/detail/schema.hpp"

#include <fmt/format.h>

#include <array>
#include <set>

namespace tunica {
namespace {

/// Calls visit(section, header, keys) for all sections.
template <typename Visit>
void for_all_keys(const Visit& visit) {
  const Scene none;
  visit("run", "[run]", scene_schema().run);
  for_each_section(none, [&](std::string_view section, const auto& keys, const auto&) {
    visit(section, fmt::format("[[{}]]", section), keys);
  });
  visit("accuracy", "[accuracy]", scene_schema().accuracy);
}

std::string without_quotes(std::string text) {
  std::erase(text, '"');
  return text;
}

/// A cell of a table.
std::string cell(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    safe += c == '|' ? "\\|" : std::string(1, c);
  }
  return safe;
}

}  // namespace

std::string help_of_key(std::string_view section, std::string_view key) {
  std::string help;
  for_all_keys([&](std::string_view of, std::string_view, const auto& keys) {
    const auto found = std::ranges::find(keys, key, [](const auto& one) { return one.name; });
    if (of == section && found != keys.end()) {
      const bool is_choice = found->access->like().find(" | ") != std::string::npos;
      help = std::string(found->says);
      help += is_choice && !found->fallback().empty() ? fmt::format(" (default {})", without_quotes(found->fallback()))
                                                      : "";
    }
  });
  return help;
}

std::string scene_manual() {
  std::string manual;
  for_all_keys([&](std::string_view, std::string_view header, const auto& keys) {
    manual += fmt::format("\n### `{}`\n\n| key | value | default | |\n|---|---|---|---|\n", header);
    std::set<std::array<std::string_view, 3>> said;  // what several kinds share
    for (const auto& key : keys) {
      const std::string_view like = key.access->like();
      const bool is_new = said.insert({key.name, like, ""}).second;
      const bool says_more = said.insert({key.name, like, key.says}).second;
      if (is_new || says_more) {
        const std::string fallback = key.fallback();
        const std::string otherwise = key.is_needed ? "needed" : fallback.empty() ? "" : "`" + fallback + "`";
        const std::optional<Range> limits = key.access->range();
        const std::string range = limits ? ", " + limits->text() : "";
        manual +=
            fmt::format("| `{}` | `{}`{} | {} | {} |\n", key.name, cell(like), range, cell(otherwise), cell(key.says));
      }
    }
  });
  return manual;
}

}  // namespace tunica
