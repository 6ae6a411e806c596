#pragma once

#include "tunica/io/result/detail/result_grid.hpp"

#include <filesystem>
#include <string>

namespace tunica {

/// The shells of a state, displaced, as a surface coloured by their von Mises stress from 0 to the largest, which its
/// provenance states. Errors: OutputError.
/// @param values  as ResultGrid::values() gives them; space  world axes, as PlyOptions
void write_result_surface(const std::filesystem::path& path, const ResultGrid& grid,
                          const std::vector<std::vector<float>>& values, const std::string& made_by,
                          const std::string& space, bool overwrite);

}  // namespace tunica
