#pragma once

#include <cstddef>
#include <functional>

namespace tunica {

/// Limits parallel_for_blocks() to `count` threads (at least 1) from now on, for the whole process.
void set_thread_count(std::size_t count);

/// The limit in force; at the start `default_thread_count()`.
std::size_t thread_count();

/// TUNICA_THREADS, else SLURM_CPUS_PER_TASK, else the processors this process may use.
/// Errors: UsageError when the variable is not a positive whole number.
std::size_t default_thread_count();

/// Runs body(begin, end) over [0, size) in blocks of `grain` (the last may be shorter), in parallel, in any order.
/// The blocks are the same whatever the number of threads: a result that is stored per block and combined in block
/// order does not depend on it. An exception of a body is rethrown here after the others ended.
void parallel_for_blocks(std::size_t size, std::size_t grain,
                         const std::function<void(std::size_t begin, std::size_t end)>& body);

}  // namespace tunica
