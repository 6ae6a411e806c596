#pragma once

#include "volume/volume.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tunica {

struct Label {
  double value = 0;        ///< slope * v + intercept
  std::size_t voxels = 0;  ///< at least 1
  double volume_mm3 = 0;   ///< voxels times the volume of one
  std::string name;        ///< empty where the file has none
};

/// All values of a segmentation but 0 and NaN, in increasing order, with their sizes.
/// @return none when there are more than `limit` different values: the volume is an image, not a segmentation
/// Cost: one pass over the volume.
std::optional<std::vector<Label>> list_labels(const Volume& volume, std::size_t limit = 65536);

}  // namespace tunica
