#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace tunica {

/// How marching cubes cuts one cell. Corner c is at (c & 1, c >> 1 & 1, c >> 2); bit c of a case says it is inside.
/// Edges 0-3 run along x at (y, z) = (0,0) (1,0) (0,1) (1,1); 4-7 along y at (x, z); 8-11 along z at (x, y).
struct CubeCase {
  std::size_t count = 0;  ///< triangles, at most 5
  /// Edges of each triangle's vertices, counter-clockwise seen from outside.
  std::array<std::array<std::uint8_t, 3>, 5> triangles{};
};

/// The two corners of each edge.
inline constexpr std::array<std::array<std::uint8_t, 2>, 12> cube_edges{
    {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};

/// The 256 cases, derived by program. Each face is cut so that inside corners which touch only across the face's
/// diagonal stay apart, the same from both sides; the pieces close to loops; each loop is triangulated without a
/// diagonal between two points of one face, which the neighbour's triangles might use as well (there always is such a
/// triangulation; the one whose worst triangle is best is taken).
const std::array<CubeCase, 256>& cube_cases();

}  // namespace tunica
