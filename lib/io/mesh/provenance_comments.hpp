#pragma once

#include "tunica/io/mesh/mesh_file.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>

namespace tunica {

/// What a mesh made of another one goes on to say of the image behind both: the comments `voxel x y z mm`, as they are.
inline std::vector<std::string> voxel_comments(const MeshFile& file) {
  std::vector<std::string> kept;
  std::ranges::copy_if(file.comments, std::back_inserter(kept),
                       [](std::string_view comment) { return comment.starts_with("voxel "); });
  return kept;
}

/// The comment of shells that were moved from a face of the wall to its middle.
inline constexpr std::string_view middle_of_wall = "middle of the wall";

/// Whether a file says so.
inline bool is_middle_of_wall(const MeshFile& file) {
  return std::ranges::find(file.comments, middle_of_wall) != file.comments.end();
}

}  // namespace tunica
