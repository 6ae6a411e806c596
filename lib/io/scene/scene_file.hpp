#pragma once

#include "tunica/io/scene/scene.hpp"

#include <filesystem>
#include <string>

namespace tunica {

/// Reads a scene file (TOML). Mesh paths are relative to the file. The result has passed check_scene().
/// Errors: InputError "FILE:line:column: what is wrong, and what to do": syntax, unknown or missing keys, wrong types
/// and units, names that match nothing. UsageError for what a later version brings ("not available yet").
Scene read_scene(const std::filesystem::path& path);

/// The same from the text of a scene. @param name  stands for the file in messages, and its folder for the scene's
Scene parse_scene(const std::string& text, const std::filesystem::path& name);

}  // namespace tunica
