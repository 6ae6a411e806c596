#include "tunica/cli/detail/option_value.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <sstream>

namespace tunica::cli {
namespace {

bool is_word(const std::string& text) {
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-'; });
}

}  // namespace

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::stringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) {
    parts.push_back(part);
  }
  return parts;
}

OptionValue value_of(const CLI::Option& option) {
  OptionValue value;
  if (option.get_items_expected_max() == 0) {
    return value;
  }
  const std::string type = option.get_type_name();
  value.placeholder = type;
  const std::size_t open = type.find('{');
  const std::size_t close = type.find('}');
  if (open != std::string::npos && close != std::string::npos && open < close) {
    value.choices = split(type.substr(open + 1, close - open - 1), ',');
    value.placeholder = fmt::format("{}", fmt::join(value.choices, "|"));
  } else if (value.placeholder.find('|') != std::string::npos) {
    for (const std::string& word : split(value.placeholder, '|')) {
      if (is_word(word)) {
        value.choices.push_back(word);
      }
    }
  }
  constexpr std::array<const char*, 13> not_files{"NAME",   "WHERE",    "N",         "INT", "UINT",    "FLOAT", "SIZE",
                                                  "NUMBER", "QUANTITY", "TOLERANCE", "KEY", "PERCENT", "DEG"};
  const auto known = [&](const char* name) { return value.placeholder == name; };
  value.file = option.get_positional() || (value.choices.empty() && std::ranges::none_of(not_files, known));
  return value;
}

bool hidden(const CLI::Option& option) { return option.get_group().empty(); }

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

std::string positional_name(const CLI::Option& option) {
  return option.get_name(true, false) + (option.get_items_expected_max() > 1 ? "..." : "");
}

}  // namespace tunica::cli
