#pragma once

#include "surface/triangle_mesh.hpp"
#include "volume/mask.hpp"
#include "volume/pinched_vertices.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

/// The kernel of marching cubes: layers of cells between two slices of bits. Internal to lib/volume.
namespace tunica::cell_layers {

using Word = std::uint64_t;
inline constexpr std::size_t word_bits = 64;

/// The part of an image that is looked at: whole rows.
struct Window {
  std::array<std::size_t, 3> first{0, 0, 0};  ///< outside of the box [first, first + size) no voxel is inside
  std::array<std::size_t, 3> size;            ///< along x that of the image
  std::size_t first_slice = 0;                ///< of the image's values that are at hand
};

/// A box of samples with one layer of samples around it: outside, or with an open border, where the box ends with the
/// image, what the border's samples are. Slices, rows and columns count from this padding on. A padded row is a
/// sequence of words with one more, for reading one bit ahead.
class PaddedGrid {
public:
  PaddedGrid(const Mask& mask, const Window& window, bool open);

  [[nodiscard]] std::size_t size(int axis) const { return size_[axis]; }
  [[nodiscard]] std::size_t words() const { return samples_.size(); }
  /// Bits of word `w` that are samples of a row, and those that are edges along it (or cells).
  [[nodiscard]] Word samples(std::size_t w) const { return samples_[w]; }
  [[nodiscard]] Word edges(std::size_t w) const { return edges_[w]; }

  /// A padded row, words() + 1 words. @return whether any sample in it is inside
  bool load(std::size_t row, std::size_t slice, Word* out) const;

  /// Index among the values at hand of the sample behind a padded one (the nearest, in the padding).
  [[nodiscard]] std::size_t at_hand(const std::array<std::size_t, 3>& padded) const;
  [[nodiscard]] bool is_padding(std::size_t padded, int axis) const { return padded == 0 || padded == size_[axis] - 1; }
  /// Number of a padded sample in the padded image.
  [[nodiscard]] std::size_t number(const std::array<std::size_t, 3>& padded) const;
  /// Voxel coordinate of a padded sample. With an open border the padding lies on the outer voxel faces: half a voxel
  /// out, where the surface ends.
  [[nodiscard]] double coordinate(std::size_t padded, int axis) const;
  [[nodiscard]] const Eigen::Matrix<double, 3, 4>& affine() const { return mask_.affine(); }

private:
  [[nodiscard]] std::size_t in_image(std::size_t padded, int axis) const {
    return std::clamp<std::size_t>(padded, 1, size_[axis] - 2) - 1 + window_.first[axis];
  }

  const Mask& mask_;
  Window window_;
  std::array<std::array<bool, 2>, 3> open_{};  ///< by axis and side
  std::array<std::size_t, 3> size_{};
  std::vector<Word> samples_;
  std::vector<Word> edges_;
};

/// What one slice of samples, and the layer of cells above it, contribute to the mesh. A slice's vertices are numbered
/// in this order: those on edges along x, along y, and upright to the next slice.
struct LayerCounts {
  std::size_t along_x = 0;
  std::size_t along_y = 0;
  std::size_t upright = 0;
  std::size_t triangles = 0;
  [[nodiscard]] std::size_t vertices() const { return along_x + along_y + upright; }
};

/// Counts of the padded slices [begin, end) into counts[0], counts[1], …
void count_layers(const PaddedGrid& grid, std::size_t begin, std::size_t end, LayerCounts* counts);

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

/// Writes vertices and triangles of the padded slices [begin, end), counted before, as slice `end` was in its
/// plane (counts of 0 where the grid ends).
/// @param crossings  null: every edge is crossed half-way
void write_layers(const PaddedGrid& grid, std::size_t begin, std::size_t end, const LayerCounts* counts,
                  const Output& out, const Crossings* crossings, std::vector<PinchedVertex>& pinched);

}  // namespace tunica::cell_layers
