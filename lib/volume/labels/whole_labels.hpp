#pragma once

#include "tunica/volume/labels/volume.hpp"

#include <cmath>
#include <cstddef>
#include <set>

namespace tunica {

/// How far the value of a voxel may be from the whole number that is its label. Scaling (slope 1/255 as a 32-bit float)
/// and resampling leave errors of 1e-8 to 1e-4; interpolation between labels, and grey values, miss whole numbers by
/// tenths.
inline constexpr double label_rounding = 1e-3;

/// The label that a value means: the whole number within label_rounding of it, else the value itself.
inline double label_meant(double value) {
  const double whole = std::nearbyint(value);
  return std::abs(value - whole) <= label_rounding ? whole : value;
}

/// How the values of a volume keep to whole numbers.
struct Wholeness {
  std::size_t not_zero = 0;  ///< voxels whose label_meant() is not 0; NaN and infinity are left out
  std::size_t rounded = 0;   ///< voxels that are not a whole number, but within label_rounding of one
  double farthest = 0;       ///< largest distance of these from theirs
  std::size_t between = 0;   ///< voxels that are farther from any
  double example = 0;        ///< the first of these in memory order; 0 where there is none

  /// Adds the voxels of a slab, by what they mean (slope * v + intercept); slabs in the volume's order.
  /// Errors: InputError: no volume. Cost: one pass; none over the whole numbers of a volume without scaling, whose
  /// not_zero then stays 0. Parallel.
  void add(const Volume& slab);
};

/// Whether values are those of a grey volume or of probabilities, though whole numbers: many, and neighbours differ.
/// Borders between labels are few beside the voxels within them.
struct Neighbours {
  std::set<double> values;    ///< the first of those that are not zero
  std::size_t pairs = 0;      ///< of neighbouring voxels in rows that are both not zero
  std::size_t differing = 0;  ///< of these

  void add(const Volume& slab);  ///< Errors: InputError: no volume. Cost: one pass.
  [[nodiscard]] bool are_grey() const;
};

}  // namespace tunica
