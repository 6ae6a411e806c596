#pragma once

#include "tunica/core/quantity.hpp"
#include "tunica/io/scene/scene.hpp"

#include <toml++/toml.h>

#include <span>

namespace tunica {

inline constexpr std::int64_t most_counted = 1'000'000'000;

using Keys = std::span<const std::string_view>;

/// One table of a scene file, and what it may hold. What is wrong is said with its place (InputError).
class SceneTable {
public:
  /// @param known  keys of this table
  SceneTable(const toml::table& table, const std::string& file, std::string name, Keys known);

  [[nodiscard]] const Places& places() const { return places_; }
  [[nodiscard]] const Place& place(std::string_view key) const { return places_.of(key); }
  [[nodiscard]] bool has(std::string_view key) const { return table_.contains(key); }
  [[nodiscard]] const toml::node& required(std::string_view key, std::string_view why = {}) const;

  [[nodiscard]] std::string text(std::string_view key) const { return text_of(required(key), key); }
  [[nodiscard]] std::optional<std::string> optional_text(std::string_view key) const {
    return has(key) ? std::optional(text(key)) : std::nullopt;
  }

  template <typename Value>
  void choice(std::string_view key, Value& value,
              std::initializer_list<std::pair<std::string_view, Value>> choices) const {
    if (!has(key)) {
      return;
    }
    const std::string word = text(key);
    std::vector<std::string_view> words;
    for (const auto& [name, meaning] : choices) {
      if (word == name) {
        value = meaning;
        return;
      }
      words.push_back(name);
    }
    fail_choice(key, word, words);
  }

  [[nodiscard]] double quantity(std::string_view key, Dimension dimension, std::string_view why = {}) const {
    return quantity_of(required(key, why), key, dimension);
  }
  [[nodiscard]] double number(std::string_view key) const { return number_of(required(key), key); }
  /// A text with a percent sign, or a plain part of 1.
  [[nodiscard]] double part(std::string_view key) const;
  [[nodiscard]] bool flag(std::string_view key) const;
  /// A whole number from 1 to `most`.
  [[nodiscard]] std::size_t count(std::string_view key, std::int64_t most = most_counted) const;
  [[nodiscard]] const toml::array& array(std::string_view key, std::string_view like) const;
  [[nodiscard]] Vec3 vector(std::string_view key, Dimension dimension, std::string_view like) const {
    return vector_of(required(key), key, dimension, like);
  }
  [[nodiscard]] const toml::table& table(std::string_view key, std::string_view like) const;

  [[nodiscard]] Vec3 vector_of(const toml::node& node, std::string_view key, Dimension dimension,
                               std::string_view like) const;
  [[nodiscard]] double quantity_of(const toml::node& node, std::string_view key, Dimension dimension) const;
  [[nodiscard]] double number_of(const toml::node& node, std::string_view key) const;
  [[nodiscard]] std::string text_of(const toml::node& node, std::string_view key) const;

  [[nodiscard]] Place at(const toml::source_region& region) const;
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] const std::string& name() const { return name_; }

private:
  [[noreturn]] void fail_choice(std::string_view key, const std::string& word,
                                const std::vector<std::string_view>& words) const;

  const toml::table& table_;
  const std::string& file_;
  std::string name_;
  Places places_;
};

}  // namespace tunica
