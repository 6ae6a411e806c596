#include "tunica/cli/usage.hpp"

#include "tunica/cli/detail/option_value.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/suggestion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

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

constexpr std::size_t columns = 80, descriptions_from = 30;

// Lines that end before the last column; all but the first begin with `indent` blanks. @param from  where the first
// begins
std::string wrapped(const std::string& text, std::size_t from, std::size_t indent) {
  std::string lines;
  std::size_t column = from;
  for (const std::string& word : split(text, ' ')) {
    const bool first = lines.empty();
    if (!first && column + 1 + word.size() > columns) {
      lines += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (!first) {
      lines += ' ';
      ++column;
    }
    lines += word;
    column += word.size();
  }
  return lines;
}

class HelpLayout : public CLI::Formatter {
public:
  std::string make_description(const CLI::App* app) const override {
    return wrapped(app->get_description(), 0, 0) + "\n";
  }

  std::string make_usage(const CLI::App* app, std::string) const override {
    std::string usage = short_usage(*app);
    usage.front() = 'U';
    return wrapped(usage, 0, 7) + "\n";
  }

  std::string make_option(const CLI::Option* option, bool positional) const override {
    const OptionValue value = value_of(*option);
    std::string head =
        "  " + (positional ? positional_name(*option) : fmt::format("{}", fmt::join(spellings(*option), ", ")));
    if (!positional && !value.placeholder.empty()) {
      head += ' ' + value.placeholder;
    }
    const std::string gap = head.size() + 2 > descriptions_from ? "\n" + std::string(descriptions_from, ' ')
                                                                : std::string(descriptions_from - head.size(), ' ');
    return head + gap + wrapped(option->get_description(), descriptions_from, descriptions_from) + "\n";
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_layout() { return std::make_shared<HelpLayout>(); }

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
  std::vector<std::string> words = app.remaining();
  std::erase(words, "--");
  for (const std::string& word : words) {
    if (word.starts_with("-")) {
      // A flag that is known is left over only where it was read as a file.
      if (app.get_option_no_throw(word.substr(0, word.find('='))) != nullptr) {
        return fmt::format("{} stands after --, and after that every word is a file: write flags before --", word);
      }
      return unknown_flag(app, word);
    }
  }
  const std::string option = text.substr(0, text.find(':'));
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr && !words.empty()) {
    return fmt::format("'{}' is one argument too many", words.front());
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
    // FILES are words without a flag, also those behind --.
    return text.find("required but received") != std::string::npos
               ? (option == "FILES" ? "one file too many; after -- every word is a file: write flags before --"
                                    : fmt::format("{} is given more than once or with more than one value", option))
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
