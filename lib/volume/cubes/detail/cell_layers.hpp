#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/cubes/detail/pinched_vertices.hpp"
#include "tunica/volume/labels/padded_grid.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

/// The kernel of marching cubes: layers of cells between two slices of bits. Internal to lib/volume.
namespace tunica::cell_layers {

/// What one slice of samples, and the layer of cells above it, contribute to the mesh. A slice's vertices are numbered
/// in this order: those on edges along x, along y, and along z to the next slice.
struct LayerCounts {
  std::size_t along_x = 0;
  std::size_t along_y = 0;
  std::size_t along_z = 0;
  std::size_t triangles = 0;
  /// What the triangles are counted by: how many cells of one layer have the slice's edges along x and y, taken
  /// together; and what else the layer adds.
  std::size_t in_slice = 0;
  std::ptrdiff_t in_layer = 0;
  [[nodiscard]] std::size_t vertices() const { return along_x + along_y + along_z; }
};

/// The triangles of all layers, from the counts of all padded slices.
void count_triangles(std::span<LayerCounts> counts);

/// An edge between two samples that is crossed, by the padded row and column of its first sample.
struct CrossedEdge {
  std::uint32_t row;
  std::uint32_t column;
};

/// Where edges between two samples are crossed.
class Crossings {
public:
  virtual ~Crossings() = default;
  /// Fractions of the way from the first sample at hand of each edge to the second.
  virtual void place(const std::size_t* first, const std::size_t* second, std::size_t count,
                     double* fractions) const = 0;
};

/// Where a block of slices goes to.
struct Output {
  std::size_t first_vertex = 0;  ///< number of its first one
  Vec3* vertices = nullptr;
  std::array<Index, 3>* triangles = nullptr;
};

/// A walk along layers, in memory that is kept from one block of slices to the next: one for each thread.
class Layers {
public:
  explicit Layers(const PaddedGrid& grid);
  ~Layers();

  /// Counts of the padded slices [begin, end) into counts[0], counts[1], … but for the triangles, which two slices
  /// decide.
  void count(std::size_t begin, std::size_t end, LayerCounts* counts);

  /// Writes vertices and triangles of the padded slices [begin, end), counted before, as slice `end` was in its
  /// plane (counts of 0 where the grid ends).
  /// @param crossings  null: every edge is crossed half-way
  void write(std::size_t begin, std::size_t end, const LayerCounts* counts, const Output& out,
             const Crossings* crossings, std::vector<PinchedVertex>& pinched);

private:
  struct Memory;
  const PaddedGrid& grid_;
  std::unique_ptr<Memory> memory_;
};

}  // namespace tunica::cell_layers
