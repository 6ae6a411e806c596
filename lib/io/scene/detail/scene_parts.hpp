#pragma once

#include "tunica/io/scene/detail/scene_table.hpp"

#include <filesystem>
#include <functional>

/// Reads the parts of a scene file. Errors: as SceneTable.
namespace tunica {

inline constexpr std::string_view like_point = R"(["0mm", "0mm", "10mm"])";

/// The selection under `where`. @param carried  by another body: {touching = …} is understood too
Selection read_where(const SceneTable& item, bool carried = false);

/// The factors under `ramp`, none where there is no such key. In a static run the load factor plays the part of time.
Ramp read_ramp(const SceneTable& item, bool dynamic, Scene& scene);

template <typename Value>
using ReadValue = std::function<Value(const toml::node&)>;

/// One value, or a table of values over time. @param like  a value as it may be written; read  reads and checks one
template <typename Value>
Table<Value> read_table(const SceneTable& item, std::string_view key, std::string_view like, bool dynamic, Scene& scene,
                        const ReadValue<Value>& read);

/// The sections that state bodies and what is between them, an item each.
void read_shell(const toml::table& node, const std::string& file, const std::filesystem::path& folder, Scene& scene);
void read_solid(const toml::table& node, const std::string& file, const std::filesystem::path& folder, Scene& scene);
void read_rigid(const toml::table& node, const std::string& file, const std::filesystem::path& folder, bool dynamic,
                Scene& scene);
void read_attach(const toml::table& node, const std::string& file, Scene& scene);
void read_contact(const toml::table& node, const std::string& file, Scene& scene);

/// Says of each rigid body that touches nothing that it does nothing.
void note_idle_rigids(Scene& scene);

}  // namespace tunica
