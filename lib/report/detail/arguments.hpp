#pragma once

#include "tunica/io/result/pipeline_folder.hpp"

#include <optional>
#include <string>

/// What a stage was given, as its report's `arguments` have it: by flag ("--label") or by the name of a place
/// ("VOLUME").
namespace tunica::report {

/// An object; empty where the report has none.
Json arguments_of(const PipelineCase& one, const std::string& stage);

/// The value of an argument, of several the last; none where it was not given or takes none.
std::optional<std::string> argument(const PipelineCase& one, const std::string& stage, const std::string& name);

/// The command of a tool with these arguments, as a shell needs it typed.
std::string command_of(const std::string& tool, const Json& arguments);

}  // namespace tunica::report
