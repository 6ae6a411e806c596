#include "tunica/report/detail/command_words.hpp"

namespace tunica::report {

std::vector<std::string> command_words(const std::string& command) {
  std::vector<std::string> words;
  bool inside = false;  // a word has begun
  bool quoted = false;
  for (std::size_t i = 0; i < command.size(); ++i) {
    const char sign = command[i];
    if (!quoted && sign == ' ') {
      inside = false;
      continue;
    }
    if (!inside) {
      words.emplace_back();
      inside = true;
    }
    if (sign == '\'') {
      quoted = !quoted;
    } else if (!quoted && sign == '\\' && i + 1 < command.size()) {
      words.back() += command[++i];
    } else {
      words.back() += sign;
    }
  }
  return words;
}

std::vector<std::string> words_of(const PipelineCase& one, const std::string& stage) {
  const Json command = one.at(stage, "command");
  return command_words(command.is_string() ? command.get<std::string>() : "");
}

std::optional<std::string> flag_value(const std::vector<std::string>& words, const std::string& name) {
  std::optional<std::string> value;
  for (std::size_t i = 1; i < words.size(); ++i) {
    if (words[i] == name && i + 1 < words.size()) {
      value = words[i + 1];
    } else if (words[i].starts_with(name + "=")) {
      value = words[i].substr(name.size() + 1);
    }
  }
  return value;
}

}  // namespace tunica::report
