#pragma once

#include "shell/fit_result.hpp"
#include "shell/fit_task.hpp"

namespace tunica {

/// The closest shells found of at most so many (more where the topology needs more), into the result. Few ones, or
/// those of a rough target, come from three starts, and are exchanged between where they are hardly needed and where
/// the error is largest for as long as that brings anything. Cost: see fit(). Errors: Interrupted.
void fit_to_count(const FitTask& task, std::size_t shells, FitResult& result);

}  // namespace tunica
