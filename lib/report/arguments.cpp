#include "tunica/report/detail/arguments.hpp"

#include "tunica/core/words.hpp"

namespace tunica::report {

Json arguments_of(const PipelineCase& one, const std::string& stage) {
  Json arguments = one.at(stage, "arguments");
  return arguments.is_object() ? std::move(arguments) : Json::object();
}

std::optional<std::string> argument(const PipelineCase& one, const std::string& stage, const std::string& name) {
  const Json value = arguments_of(one, stage).value(name, Json());
  const Json last = value.is_array() && !value.empty() ? value.back() : value;
  return last.is_string() ? std::optional(last.get<std::string>()) : std::nullopt;
}

std::string command_of(const std::string& tool, const Json& arguments) {
  std::string command = tool;
  for (const auto& [name, value] : arguments.items()) {
    const std::string flag = name.starts_with('-') ? ' ' + name : "";
    if (value == true) {
      command += flag;
    }
    for (const Json& one : value.is_array() ? value : Json::array({value})) {
      if (one.is_string()) {
        // A value that begins as a flag does is told from one by what stands before it.
        const auto text = one.get<std::string>();
        const bool like_flag = text.starts_with('-');
        command += flag + (flag.empty() ? like_flag ? " ./" : " " : like_flag ? "=" : " ") + shell_quoted(text);
      }
    }
  }
  return command;
}

}  // namespace tunica::report
