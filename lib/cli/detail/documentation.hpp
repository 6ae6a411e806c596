#pragma once

#include <CLI/CLI.hpp>

#include <string>

/// Man pages and shell completion, made from the options a tool declares: they cannot disagree with --help.
namespace tunica::cli {

/// The manual page in man(7) format: NAME, SYNOPSIS, DESCRIPTION, OPTIONS, EXIT STATUS, FILES, ENVIRONMENT, EXAMPLE.
std::string man_page(const CLI::App& tool);

/// A bash completion script for the tool: flags, the values that an option allows, file names.
std::string bash_completion(const CLI::App& tool);

/// The same for zsh, with the beginning of each description: a file _TOOL for a folder of $fpath.
std::string zsh_completion(const CLI::App& tool);

/// The same for fish.
std::string fish_completion(const CLI::App& tool);

}  // namespace tunica::cli
