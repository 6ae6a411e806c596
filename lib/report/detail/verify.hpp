#pragma once

#include "tunica/io/result/pipeline_folder.hpp"

#include <set>
#include <string>
#include <vector>

namespace tunica::report {

/// What a case's folder is called within OUT, such as "aorta/1".
using CaseFolders = std::set<std::string>;
CaseFolders folders_of(const std::vector<PipelineCase>& cases);

/// How the files of a case differ from what its reports say, a sentence each: outputs that are missing or have another
/// SHA-256, stages that read other files than the stages before wrote, files with a stage's names that no report tells
/// of, a folder that was another case's. Cost: reads every output once; where --no-paths left out names, every file of
/// the case's folder. Limits: only files that the reports of `one` name, and those with the names that
/// Makefile.pipeline gives.
/// @param all  folders of all cases of the run
std::vector<std::string> differences(const PipelineCase& one, const CaseFolders& all);

}  // namespace tunica::report
