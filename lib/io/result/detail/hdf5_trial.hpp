#pragma once

#include <filesystem>
#include <span>

namespace tunica::hdf5 {

/// Whether HDF5 opens the data sets of a file, or says what is wrong with them, without a fault of its own. HDF5 1.10
/// divides by zero where a damaged file says that a chunk has no dimensions. A child process opens them, so that the
/// fault ends the child. True where no child can be started. Cost: one fork per file.
[[nodiscard]] bool opens_without_fault(const std::filesystem::path& path, std::span<const char* const> datasets);

}  // namespace tunica::hdf5
