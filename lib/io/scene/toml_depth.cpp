#include "tunica/io/scene/detail/toml_depth.hpp"

#include <algorithm>

namespace tunica {
namespace {

// The position after the string that begins at `at` with a quote: basic or literal, of one line or of several.
std::size_t skip_string(std::string_view toml, std::size_t at) {
  const char quote = toml[at];
  const std::string_view three = quote == '"' ? "\"\"\"" : "'''";
  const bool several_lines = toml.substr(at, 3) == three;
  const std::string_view mark = several_lines ? three : three.substr(0, 1);
  for (at += mark.size(); at < toml.size(); ++at) {
    if (quote == '"' && toml[at] == '\\') {
      ++at;
    } else if (toml[at] == '\n' && !several_lines) {
      return at;
    } else if (toml.substr(at, mark.size()) == mark) {
      return at + mark.size();
    }
  }
  return toml.size();
}

}  // namespace

std::size_t longest_dotted_key(std::string_view toml) {
  std::size_t longest = 1;
  std::size_t parts = 1;
  for (std::size_t i = 0; i < toml.size();) {
    const char c = toml[i];
    if (c == '"' || c == '\'') {
      i = skip_string(toml, i);
      continue;
    }
    if (c == '#') {
      i = std::min(toml.find('\n', i), toml.size());
      continue;
    }
    if (c == '.') {
      longest = std::max(longest, ++parts);
    } else if (std::string_view("=,[]{}\n").find(c) != std::string_view::npos) {
      parts = 1;
    }
    ++i;
  }
  return longest;
}

}  // namespace tunica
