#pragma once

#include "surface/triangle_mesh.hpp"

#include <optional>
#include <vector>

namespace tunica {

/// Where to start a walk over a mesh to what is closest to a point beside it: a triangle some steps away, whatever the
/// size of the mesh. A hash table over the cells of a grid, two mean edges wide, that triangles' centroids lie in.
/// Cost: build linear, some 5 bytes per triangle; a query one look into the table.
class StartGrid {
public:
  explicit StartGrid(const TriangleMesh& mesh);

  /// A triangle with its centroid in the cell of p. None: nothing is there.
  [[nodiscard]] std::optional<Index> near(const Vec3& p) const;

  [[nodiscard]] double cell() const { return cell_; }  ///< mm

private:
  struct Slot {
    std::uint64_t key;
    Index triangle;
  };
  [[nodiscard]] std::optional<std::uint64_t> key_of(const Vec3& p) const;
  [[nodiscard]] std::size_t place_of(std::uint64_t key) const;

  Vec3 origin_;
  double cell_;
  std::vector<Slot> table_;  // size a power of two; open addressing
  std::size_t cells_ = 0;
};

}  // namespace tunica
