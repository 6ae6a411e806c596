#pragma once

#include "tunica/core/types.hpp"

namespace tunica {

/// An indexed triangle mesh, in mm. Faces are counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Vec3> vertices;                   ///< #V positions
  std::vector<std::array<Index, 3>> triangles;  ///< #F vertex indices, each < #V
};

}  // namespace tunica
