#pragma once

#include <CLI/CLI.hpp>

#include <string>
#include <vector>

/// How help, manual pages and completions of shells see an option: one reading for all of them.
namespace tunica::cli {

/// What the words after an option stand for, read from its type name: "TEXT:{auto,linear,log}", "none|staircase|SIGMA",
/// "FILE", "N".
struct OptionValue {
  std::string placeholder;           ///< "auto|linear|log", "N"; empty for a flag
  std::vector<std::string> choices;  ///< empty: free
  bool file = false;
};

/// @return what the option takes
OptionValue value_of(const CLI::Option& option);

/// Options of later steps are declared, but not shown.
bool hidden(const CLI::Option& option);

/// "-o", "--output".
std::vector<std::string> spellings(const CLI::Option& option);

/// "VOLUME", "REPORT..." where there may be several.
std::string positional_name(const CLI::Option& option);

/// The parts of a text between separators.
std::vector<std::string> split(const std::string& text, char separator);

}  // namespace tunica::cli
