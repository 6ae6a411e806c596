#pragma once

#include "tunica/core/types.hpp"

#include <array>
#include <vector>

namespace tunica {

/// A mesh of tetrahedra. Corners 1, 2, 3 of a tetrahedron are counter-clockwise seen from outside, corner 0 is inside
/// of them: (x1 - x0) . (x2 - x0) x (x3 - x0) > 0.
struct TetMesh {
  std::vector<Vec3> vertices;                    ///< #V positions, mm
  std::vector<std::array<Index, 4>> tetrahedra;  ///< #T vertex indices
};

}  // namespace tunica
