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

}  // namespace tunica
