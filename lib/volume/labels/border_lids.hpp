// volume/labels: volumes of voxels, and the bits that say which of them are inside.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace tunica {

/// Where the surface is closed by a flat lid on the image's border although the border is open: by axis and side
/// (0: the lower one) of the image, one entry per voxel of that side, that of voxel (i, j, k) at j + dims[1] * k across
/// axis 0, i + dims[0] * k across axis 1 and i + dims[0] * j across axis 2. Empty: no lid on that side.
struct BorderLids {
  std::array<std::array<std::vector<bool>, 2>, 3> closed;

  [[nodiscard]] bool any() const {
    for (const auto& sides : closed) {
      if (!sides[0].empty() || !sides[1].empty()) {
        return true;
      }
    }
    return false;
  }
};

}  // namespace tunica
