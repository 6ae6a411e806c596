#pragma once

#include <filesystem>

namespace tunica::hdf5 {

/// Whether HDF5 opens every data set of a file without a fault of its own. HDF5 1.10 divides by zero where a damaged
/// file says that a chunk has no dimensions. A child process opens them, so that the fault ends the child. True where
/// HDF5 says itself what is wrong, and where no child can be started. Cost: one fork per file.
[[nodiscard]] bool opens_without_fault(const std::filesystem::path& path);

}  // namespace tunica::hdf5
