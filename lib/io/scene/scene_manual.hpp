#pragma once

#include <string>
#include <string_view>

/// What the schema of the scene says of its keys to the user.
namespace tunica {

/// The help of a flag that is a key of the scene: "membrane element (default adapt)".
/// @param section  "run", "shell" …; key  one of it
std::string help_of_key(std::string_view section, std::string_view key);

/// The tables of all keys in docs/scene.md, section by section, in Markdown.
std::string scene_manual();

}  // namespace tunica
