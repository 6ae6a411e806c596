#pragma once

#include <CLI/CLI.hpp>

#include <cstddef>
#include <memory>
#include <string>

namespace tunica::cli {

/// One line: the tool's name and what it needs.
std::string short_usage(const CLI::App& app);

/// How --help looks: lines of at most 80 columns, choices as they are typed.
std::shared_ptr<CLI::FormatterBase> help_layout();

/// The parser's error in words that say what to do: an unknown flag is named before a missing argument, which is often
/// only its consequence; the option that was probably meant is named.
std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

/// A validator for a whole number from `lower` to `upper`.
CLI::Validator whole_number(std::size_t lower, std::size_t upper = std::size_t{1} << 31);

}  // namespace tunica::cli
