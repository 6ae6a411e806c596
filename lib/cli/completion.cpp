#include "tunica/cli/detail/documentation.hpp"

#include "tunica/cli/detail/option_value.hpp"
#include "tunica/core/version.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

namespace tunica::cli {
namespace {

// The beginning of a description that can stand alone in a list, between single quotes of a shell.
std::string in_short(const CLI::Option& option, std::string_view escaped_quote, std::string_view special) {
  constexpr std::size_t most = 72;
  const std::string& whole = option.get_description();
  std::string text = whole.substr(0, whole.find(';'));
  if (text.size() > most) {
    text.resize(text.rfind(' ', most));
    text += " ...";
  }
  std::string quoted;
  for (const char c : text) {
    if (c == '\'') {
      quoted += escaped_quote;
    } else {
      quoted += (special.find(c) != std::string_view::npos ? "\\" : "") + std::string(1, c);
    }
  }
  return quoted;
}

std::vector<const CLI::Option*> shown_options(const CLI::App& tool) {
  return tool.get_options([](const CLI::Option* option) { return !hidden(*option) && !option->get_positional(); });
}

}  // namespace

std::string bash_completion(const CLI::App& tool) {
  std::vector<std::string> flags;
  std::string cases;
  for (const CLI::Option* option : tool.get_options()) {
    if (hidden(*option) || option->get_positional()) {
      continue;
    }
    const std::vector<std::string> names = spellings(*option);
    flags.insert(flags.end(), names.begin(), names.end());
    const OptionValue value = value_of(*option);
    if (value.placeholder.empty()) {
      continue;
    }
    const std::string action =
        !value.choices.empty()
            ? fmt::format("mapfile -t COMPREPLY < <(compgen -W '{}' -- \"$current\")", fmt::join(value.choices, " "))
        : value.file ? std::string("_tunica_files \"$current\"")
                     : std::string("COMPREPLY=()");
    cases += fmt::format("    {}) {}; return ;;\n", fmt::join(names, "|"), action);
  }
  std::string function = "_" + tool.get_name();
  std::ranges::replace(function, '-', '_');
  return fmt::format(R"(# bash completion for {0} {1}, made from its options

_tunica_files() {{
  mapfile -t COMPREPLY < <(compgen -f -- "$1")
  compopt -o filenames 2>/dev/null
}}

{2}() {{
  local current="${{COMP_WORDS[COMP_CWORD]}}" previous="${{COMP_WORDS[COMP_CWORD-1]}}"
  COMPREPLY=()
  # --flag=value arrives as three words
  if [[ $current == '=' ]]; then
    current=''
  elif [[ $previous == '=' && $COMP_CWORD -ge 2 ]]; then
    previous="${{COMP_WORDS[COMP_CWORD-2]}}"
  fi
  case "$previous" in
{3}  esac
  if [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W '{4}' -- "$current")
  else
    _tunica_files "$current"
  fi
}}

complete -F {2} {0}
)",
                     tool.get_name(), version, function, cases, fmt::join(flags, " "));
}

std::string zsh_completion(const CLI::App& tool) {
  std::string lines;
  for (const CLI::Option* option : shown_options(tool)) {
    const OptionValue value = value_of(*option);
    const bool repeats = option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
    const std::vector<std::string> names = spellings(*option);
    std::string action;
    if (!value.placeholder.empty()) {
      std::string placeholder = value.placeholder;
      std::erase_if(placeholder, [](char c) { return c == ':' || c == '\''; });
      action = fmt::format(":{}:{}", placeholder,
                           !value.choices.empty() ? fmt::format("({})", fmt::join(value.choices, " "))
                           : value.file           ? "_files"
                                                  : "");
    }
    for (const std::string& name : names) {
      const char* const assigned = action.empty() ? "" : name.starts_with("--") ? "=" : "+";
      lines += fmt::format("  '{}{}{}[{}]{}' \\\n", repeats ? "*" : fmt::format("({})", fmt::join(names, " ")), name,
                           assigned, in_short(*option, R"('\'')", "[]:\\"), action);
    }
  }
  return fmt::format(
      "#compdef {0}\n# zsh completion for {0} {1}, made from its options\n\n_arguments \\\n{2}  '*:file:_files'\n",
      tool.get_name(), version, lines);
}

std::string fish_completion(const CLI::App& tool) {
  std::string lines;
  for (const CLI::Option* option : shown_options(tool)) {
    const OptionValue value = value_of(*option);
    std::string line = fmt::format("complete -c {}", tool.get_name());
    for (const std::string& name : option->get_snames()) {
      line += fmt::format(" -{} {}", name.size() > 1 ? "o" : "s", name);
    }
    for (const std::string& name : option->get_lnames()) {
      line += " -l " + name;
    }
    if (!value.choices.empty()) {
      line += fmt::format(" -x -a '{}'", fmt::join(value.choices, " "));
    } else if (!value.placeholder.empty()) {
      line += value.file ? " -r" : " -x";
    }
    lines += fmt::format("{} -d '{}'\n", line, in_short(*option, R"(\')", "\\"));
  }
  return fmt::format("# fish completion for {} {}, made from its options\n{}", tool.get_name(), version, lines);
}

}  // namespace tunica::cli
