#pragma once

#include "tunica/io/result/detail/hdf5_file.hpp"

#include <vector>

namespace tunica::hdf5 {

/// Whether the chunks of `data` that hold the rows from `start`, `extent` of them (one number per dimension), give as
/// many bytes as a chunk has. HDF5 1.10 takes that for granted, and of a shorter one reads what lies behind it in
/// memory. Chunks of other filters than tunica's (shuffle, deflate) are refused. Cost: inflates the chunks once.
/// `data` is of a file of opened_for_reading().
[[nodiscard]] bool chunks_are_whole(const Handle& data, const std::vector<Size>& start,
                                    const std::vector<Size>& extent);

}  // namespace tunica::hdf5
