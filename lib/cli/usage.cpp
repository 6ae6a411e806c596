#include "tunica/cli/usage.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string_view>
#include <vector>

namespace tunica::cli {

namespace {

std::string unknown_flag(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_group().empty() ? std::vector<std::string>{} : option->get_lnames()) {
      names.push_back("--" + name);
    }
  }
  const std::string near =
      nearest(word.substr(0, word.find('=')), std::vector<std::string_view>(names.begin(), names.end()));
  return fmt::format("'{}' is not an option of {}{}", word, app.get_name(),
                     near.empty() ? "" : fmt::format("; did you mean {}?", near));
}

}  // namespace

std::string short_usage(const CLI::App& app) {
  std::string words;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) {
      const std::string name = option->get_name(true, false) + (option->get_items_expected_max() > 1 ? "..." : "");
      words += option->get_required() ? " " + name : fmt::format(" [{}]", name);
    } else if (option->get_required()) {
      words += fmt::format(" {} {}", option->get_name(), option->get_type_name());
    }
  }
  return fmt::format("usage: {} [OPTIONS]{}", app.get_name(), words);
}

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  for (const std::string& word : app.remaining()) {
    if (word.starts_with("-")) {
      return unknown_flag(app, word);
    }
  }
  const std::string option = text.substr(0, text.find(':'));
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr && !app.remaining().empty()) {
    return fmt::format("'{}' is one argument too many", app.remaining().front());
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    return text.find("required but received") != std::string::npos
               ? fmt::format("{} is given more than once or with more than one value", option)
               : fmt::format("{} needs a value", option);
  }
  return text;
}

CLI::Validator whole_number(std::size_t lower, std::size_t upper) {
  return {[=](const std::string& text) {
            const std::optional<double> number = parse_number(text);
            const bool good = number && *number == std::floor(*number) && *number >= real(lower) &&
                              *number <= real(upper) && text.find_first_not_of("0123456789") == std::string::npos;
            return good ? std::string() : fmt::format("'{}' is not a whole number from {} to {}", text, lower, upper);
          },
          "", "whole number"};
}

}  // namespace tunica::cli
