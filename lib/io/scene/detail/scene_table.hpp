#pragma once

#include "tunica/io/scene/scene.hpp"

#include <toml++/toml.h>

#include <span>

namespace tunica {

/// A scene file that is being read.
struct SceneSource {
  std::string file;              ///< as messages name it
  std::filesystem::path folder;  ///< to which its paths are relative
  Scene& scene;                  ///< as far as it is read
};

/// One table of a scene file, and what it may hold. What is wrong is said with its place (InputError).
class SceneTable {
public:
  /// @param known  keys of this table
  SceneTable(const toml::table& table, SceneSource& source, std::string name, std::span<const std::string_view> known);

  [[nodiscard]] const Places& places() const { return places_; }
  [[nodiscard]] const Place& place(std::string_view key) const { return places_.of(key); }
  [[nodiscard]] bool has(std::string_view key) const { return table_.contains(key); }
  [[nodiscard]] const toml::node& required(std::string_view key, std::string_view why = {}) const;
  /// Of a value in this table.
  [[nodiscard]] Place at(const toml::node& node) const;
  [[nodiscard]] SceneSource& source() const { return source_; }
  [[nodiscard]] const std::string& name() const { return name_; }

private:
  const toml::table& table_;
  SceneSource& source_;
  std::string name_;
  Places places_;
};

}  // namespace tunica
