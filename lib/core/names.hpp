#pragma once

#include <array>
#include <string_view>
#include <type_traits>
#include <variant>

namespace tunica {

/// A value and the word by which scenes, command lines, reports and messages call it.
template <typename Value>
struct Named {
  std::string_view word;
  Value value;
  std::string_view note{};  ///< what `--help` and the manual say of it in parentheses
};

/// The names of an enumeration, in the order in which they are offered. Each stands next to its enumeration, as a
/// specialisation, and nowhere else.
template <typename Value>
inline constexpr std::array<Named<Value>, 0> names_of{};

/// What a value is called; empty where it has no name.
template <typename Value>
requires std::is_enum_v<Value>
constexpr std::string_view name_of(Value value) {
  for (const Named<Value>& named : names_of<Value>) {
    if (named.value == value) {
      return named.word;
    }
  }
  return {};
}

/// What the kind is called that a variant holds, each kind with its `name`.
template <typename... Kinds>
std::string_view name_of(const std::variant<Kinds...>& variant) {
  return std::visit([]<typename Kind>(const Kind&) -> std::string_view { return Kind::name; }, variant);
}

}  // namespace tunica
