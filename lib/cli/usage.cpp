#include "tunica/cli/usage.hpp"

#include "tunica/core/quantity.hpp"

#include <fmt/format.h>

#include <cmath>
#include <vector>

namespace tunica::cli {

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const std::string text = error.what();
  for (const std::string& word : app.remaining()) {
    if (word.starts_with("-")) {
      return fmt::format("'{}' is not an option of {}", word, app.get_name());
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
            const bool good = number && *number == std::floor(*number) && *number >= static_cast<double>(lower) &&
                              *number <= static_cast<double>(upper) &&
                              text.find_first_not_of("0123456789") == std::string::npos;
            return good ? std::string() : fmt::format("'{}' is not a whole number from {} to {}", text, lower, upper);
          },
          "", "whole number"};
}

}  // namespace tunica::cli
