#include "tunica/cli/detail/documentation.hpp"

#include "tunica/core/version.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <vector>

namespace tunica::cli {
namespace {

// What the words after an option stand for, read from its type name: "SCALE:{auto,linear,log}", "mm|cm", "FILE", "N".
struct Value {
  std::string placeholder;           ///< empty for a flag
  std::vector<std::string> choices;  ///< empty: free
  bool described = false;            ///< the choices are named in the description
  bool file = false;
};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) {
    parts.push_back(part);
  }
  return parts;
}

bool is_word(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-'; });
}

// The words of a description that ends in a choice: "bending element: comas (the paper's) | dkt (default dkt)".
std::vector<std::string> described_choices(const std::string& description) {
  std::string plain;
  int depth = 0;
  for (const char c : description) {
    depth += c == '(' ? 1 : 0;
    if (depth == 0) {
      plain += c;
    }
    depth -= c == ')' ? 1 : 0;
  }
  if (plain.find('|') == std::string::npos) {
    return {};
  }
  const std::size_t colon = plain.rfind(": ", plain.find('|'));
  std::vector<std::string> words;
  for (const std::string& part : split(colon == std::string::npos ? plain : plain.substr(colon + 2), '|')) {
    const std::size_t begin = std::min(part.find_first_not_of(' '), part.size());
    const std::string word = part.substr(begin, part.find_last_not_of(' ') + 1 - begin);
    if (is_word(word)) {
      words.push_back(word);
    }
  }
  return words.size() > 1 ? words : std::vector<std::string>{};
}

Value value_of(const CLI::Option& option) {
  Value value;
  if (option.get_items_expected_max() == 0) {
    return value;
  }
  const std::string type = option.get_type_name();
  const std::size_t colon = type.find(':');
  value.placeholder = type.substr(0, colon);
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}');
  if (open != std::string::npos && close != std::string::npos && open < close) {
    value.choices = split(type.substr(open + 1, close - open - 1), ',');
  } else if (value.placeholder.find('|') != std::string::npos) {
    for (const std::string& word : split(value.placeholder, '|')) {
      if (is_word(word)) {
        value.choices.push_back(word);
      }
    }
  }
  if (value.choices.empty()) {
    value.choices = described_choices(option.get_description());
    value.described = !value.choices.empty();
  }
  constexpr std::array<const char*, 12> not_files{"NAME",   "WHERE",    "N",         "INT", "UINT",    "FLOAT",
                                                  "NUMBER", "QUANTITY", "TOLERANCE", "KEY", "PERCENT", "DEG"};
  const auto known = [&](const char* name) { return value.placeholder == name; };
  value.file = option.get_positional() || (value.choices.empty() && std::ranges::none_of(not_files, known));
  return value;
}

bool hidden(const CLI::Option& option) { return option.get_group().empty(); }

// "-o", "--output"
std::vector<std::string> spellings(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_snames()) {
    names.push_back("-" + name);
  }
  for (const std::string& name : option.get_lnames()) {
    names.push_back("--" + name);
  }
  return names;
}

// Literal text for man(7): no escapes, no hyphenation of minus signs, no line that is taken for a request.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) {
      out += "\\&";
      out += c;
    } else {
      out += c;
    }
  }
  return out;
}

std::string capital(std::string text) {
  if (!text.empty() && text.front() >= 'a' && text.front() <= 'z') {
    text.front() = static_cast<char>(text.front() - 'a' + 'A');
  }
  return text;
}

// The first sentence without its full stop, for the line that apropos(1) shows.
std::string first_sentence(const std::string& text) {
  std::string sentence = text.substr(0, text.find('\n'));
  for (std::size_t i = 0; i + 2 < sentence.size(); ++i) {
    // A small letter goes on: "e.g. this".
    if (sentence[i] == '.' && sentence[i + 1] == ' ' && sentence[i + 2] >= 'A' && sentence[i + 2] <= 'Z') {
      sentence.resize(i);
    }
  }
  if (!sentence.empty() && sentence.back() == '.') {
    sentence.pop_back();
  }
  if (sentence.size() > 1 && sentence[0] >= 'A' && sentence[0] <= 'Z' && sentence[1] >= 'a' && sentence[1] <= 'z') {
    sentence.front() = static_cast<char>(sentence.front() - 'A' + 'a');
  }
  return sentence;
}

std::string positional_name(const CLI::Option& option) {
  return option.get_name(true, false) + (option.get_items_expected_max() > 1 ? "..." : "");
}

std::string synopsis(const CLI::App& tool) {
  std::string line = fmt::format(".B {}\n[\\fIOPTION\\fR]...", roff(tool.get_name()));
  for (const CLI::Option* option : tool.get_options()) {
    if (hidden(*option)) {
      continue;
    }
    if (option->get_positional()) {
      const std::string name = fmt::format("\\fI{}\\fR", roff(positional_name(*option)));
      line += option->get_required() ? " " + name : fmt::format(" [{}]", name);
    } else if (option->get_required()) {
      line +=
          fmt::format(" \\fB{}\\fR \\fI{}\\fR", roff(spellings(*option).front()), roff(value_of(*option).placeholder));
    }
  }
  return line + "\n";
}

std::string option_entry(const CLI::Option& option) {
  const Value value = value_of(option);
  std::string entry = ".TP\n";
  if (option.get_positional()) {
    entry += fmt::format("\\fI{}\\fR\n", roff(positional_name(option)));
  } else {
    std::vector<std::string> names;
    for (const std::string& name : spellings(option)) {
      names.push_back(fmt::format("\\fB{}\\fR", roff(name)));
    }
    entry += fmt::format("{}", fmt::join(names, ", "));
    entry += value.placeholder.empty() ? "\n" : fmt::format(" \\fI{}\\fR\n", roff(value.placeholder));
  }
  const std::string description = capital(option.get_description());
  entry += roff(description) + (description.ends_with('.') ? "\n" : ".\n");
  if (!value.choices.empty() && !value.described) {
    entry += roff(fmt::format("One of {}.", fmt::join(value.choices, ", "))) + "\n";
  }
  if (option.get_required()) {
    entry += "Required.\n";
  }
  return entry;
}

std::string examples(const CLI::App& tool) {
  std::string text = ".nf\n.RS\n";
  std::vector<std::string> lines = split(tool.get_footer(), '\n');
  for (std::size_t i = 1; i < lines.size(); ++i) {  // the first is the heading "Example:"
    const std::size_t start = std::min(lines[i].find_first_not_of(' '), lines[i].size());
    text += roff(lines[i].substr(start)) + "\n";
  }
  return text + ".RE\n.fi\n";
}

constexpr const char* closing_sections = R"(.SH EXIT STATUS
.TP
.B 0
Done; every stated requirement is met.
.TP
.B 1
Internal error.
.TP
.B 2
Usage: an unknown or missing flag, a number without its unit, a contradiction.
.TP
.B 3
Bad input: a file is missing, unreadable, damaged, or not fit for the work.
.TP
.B 4
A stated requirement was not met: tolerance, count, convergence, equilibrium.
.TP
.B 5
An output or the report could not be written, or exists and
.B \-\-force
was not given, or another run is writing it.
.TP
.B 6
Out of memory, or of the limit that is set on it.
.TP
.BR 129 ", " 130 ", " 143
Stopped by SIGHUP, SIGINT or SIGTERM.
.SH FILES
.TP
.IR OUTPUT .part
Every output is written under this name, flushed, and renamed: a file is whole or not there.
After a requirement that was not met or a signal it holds the best or last good state.
.TP
.I REPORT
With
.B \-\-report
a JSON record of the run: inputs and outputs with their SHA\-256, seconds of each stage, peak memory, and the results;
also, with the error, when the run fails.
.SH ENVIRONMENT
.TP
.B TUNICA_THREADS
Number of threads when
.B \-\-threads
is not given.
.TP
.B SLURM_CPUS_PER_TASK
The same, where TUNICA_THREADS is not set.
)";

}  // namespace

std::string man_page(const CLI::App& tool) {
  std::string upper = tool.get_name();
  std::ranges::transform(upper, upper.begin(), [](char c) { return c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c; });
  std::string page = fmt::format(".TH {} 1 \"\" \"tunica {}\" \"tunica manual\"\n", roff(upper), version);
  page += fmt::format(".SH NAME\n{} \\- {}\n", roff(tool.get_name()), roff(first_sentence(tool.get_description())));
  page += ".SH SYNOPSIS\n" + synopsis(tool);
  page += ".SH DESCRIPTION\n" + roff(tool.get_description()) + "\n";
  page += ".SH OPTIONS\n";
  for (const bool positional : {true, false}) {
    for (const CLI::Option* option : tool.get_options()) {
      if (!hidden(*option) && option->get_positional() == positional) {
        page += option_entry(*option);
      }
    }
  }
  page += closing_sections;
  page += ".SH EXAMPLE\n" + examples(tool);
  return page;
}

std::string bash_completion(const CLI::App& tool) {
  std::vector<std::string> flags;
  std::string cases;
  for (const CLI::Option* option : tool.get_options()) {
    if (hidden(*option) || option->get_positional()) {
      continue;
    }
    const std::vector<std::string> names = spellings(*option);
    flags.insert(flags.end(), names.begin(), names.end());
    const Value value = value_of(*option);
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

}  // namespace tunica::cli
