// volume/cubes: marching cubes: from voxels to a closed surface.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstdint>

namespace tunica {

/// Finds where a marching-cubes surface crosses itself whose vertices have moved by less than half a voxel along each
/// axis. Each triangle came from one cell between eight samples and has left it by less than half a cell, so that only
/// triangles of the same cell or of cells that touch can have met.
/// Cost: linear, about 0.3 microseconds per triangle and search on one thread; parallel.
class CellCrossings {
public:
  /// @param triangles  must live as long
  /// @param start      #V vertices of the surface as extracted, in voxels
  CellCrossings(const std::vector<std::array<Index, 3>>& triangles, const std::vector<Vec3>& start);

  /// The pairs of triangles that touch or cross, but for those that have an edge in common and for the corner that
  /// others have in common, ascending. Exact predicates. @param places  #V where the vertices are now
  [[nodiscard]] std::vector<std::array<Index, 2>> find(const std::vector<Vec3>& places) const;

private:
  const std::vector<std::array<Index, 3>>& triangles_;
  std::vector<std::uint64_t> cell_;  // #F ascending
  std::vector<Index> in_cell_;       // #F the triangle of each
};

}  // namespace tunica
