#pragma once

#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

struct Label {
  double value = 0;        ///< label_meant() of slope * v + intercept
  std::size_t voxels = 0;  ///< at least 1
  double volume_mm3 = 0;   ///< voxels times the volume of one
  std::string name;        ///< empty where the file has none; several with " / " between them
};

/// All labels of a segmentation that comes slab by slab, so that the surfaces of hundreds of them take one pass over
/// its voxels: for each label the words of its mask that are not 0. Labels are values other than 0 and NaN. Cost: one
/// pass over the volume; 12 bytes for every 64 voxels of a row and every label among them; for most atlases a quarter
/// of a byte for each voxel that has a label. Limits: a volume of more than 2^38 voxels (InputError).
class LabelIndex {
public:
  /// @param limit  with more different values the volume is an image, not a segmentation, and nothing is kept
  LabelIndex(const std::array<std::size_t, 3>& dims, const Eigen::Matrix<double, 3, 4>& affine,
             std::size_t limit = 65536);

  /// Takes the slices [first_slice, first_slice + slab.dims[2]). Errors: InputError: require_slab();
  /// a label of 64 bits that no double is equal to.
  void add(const Volume& slab, std::size_t first_slice);

  /// In increasing order, with their sizes; none of an image. @param names  of labels, by value
  [[nodiscard]] std::optional<std::vector<Label>> labels(
      const std::vector<std::pair<double, std::string>>& names = {}) const;

  /// The voxels with a label that labels() lists, and where they are. Errors: InputError: it lists no such label.
  [[nodiscard]] Mask mask(double label) const;
  [[nodiscard]] MaskBounds bounds(double label) const;

  /// Vertices of the closed surface of a label that labels() lists: edges between a voxel with it and one without.
  /// Its surface has about twice as many triangles. Errors: as mask(). Cost: one pass over the label's words.
  [[nodiscard]] std::size_t surface_vertices(double label) const;

private:
  struct Entry {
    std::size_t voxels = 0;
    MaskBounds bounds{};
    std::vector<std::uint32_t> at;    ///< words of the mask in memory order
    std::vector<std::uint64_t> bits;  ///< and what they hold
  };
  template <typename Meaning>
  struct Piece;
  template <typename Meaning, typename T>
  void add_values(const Volume& slab, const std::vector<T>& values, std::size_t first_slice);
  [[nodiscard]] const Entry& entry_of(double label) const;
  template <typename Meaning>
  void add_pieces(const std::vector<Piece<Meaning>>& pieces);

  std::array<std::size_t, 3> dims_;
  Eigen::Matrix<double, 3, 4> affine_;
  std::size_t limit_;
  bool image_ = false;  ///< there were too many values
  std::map<double, Entry> entries_;
};

}  // namespace tunica
