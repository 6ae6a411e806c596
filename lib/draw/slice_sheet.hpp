#pragma once

#include "tunica/core/types.hpp"

#include <string>
#include <vector>

namespace tunica {

/// A slice of an image: samples in rows from the top, each a square or rectangle of the plane.
struct SlicePanel {
  int columns = 0;
  int rows = 0;
  Vec2 spacing = Vec2::Ones();          ///< mm per column and row
  std::vector<unsigned char> grey;      ///< columns x rows: 0 black … 255 white
  std::vector<unsigned char> selected;  ///< columns x rows: 1 where the sample belongs to the organ
  /// Pieces of the outline, in columns and rows; (0, 0) is the middle of the first sample.
  std::vector<std::array<Vec2, 2>> outline;
};

/// Draws slices side by side, `columns` in a row, each in a square of `pixels`, all at the same scale in mm.
/// What is selected is tinted blue, the outline is amber. @return a PNG
/// Errors: InputError: nothing to draw, not one value per sample, spacings that are not finite and above zero, a sheet
/// larger than a PNG can be.
/// @param panels  at least one, each with at least one sample
std::string slice_sheet(const std::vector<SlicePanel>& panels, int columns, int pixels);

}  // namespace tunica
