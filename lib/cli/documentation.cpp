#include "tunica/cli/detail/documentation.hpp"

#include "tunica/cli/detail/option_value.hpp"
#include "tunica/core/version.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <sstream>
#include <vector>

namespace tunica::cli {
namespace {

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
  const OptionValue value = value_of(option);
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

}  // namespace tunica::cli
