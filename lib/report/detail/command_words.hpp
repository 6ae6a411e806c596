#pragma once

#include "tunica/io/result/pipeline_folder.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tunica::report {

/// The words of a command as a report tells it: quoted as for the shell.
std::vector<std::string> command_words(const std::string& command);

/// Those of the command that a stage's report tells; none where it tells none.
std::vector<std::string> words_of(const PipelineCase& one, const std::string& stage);

/// The value of a flag, "--name value" or "--name=value"; none where it was not given. The last one counts.
std::optional<std::string> flag_value(const std::vector<std::string>& words, const std::string& name);

}  // namespace tunica::report
