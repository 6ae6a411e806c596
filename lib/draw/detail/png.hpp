#pragma once

#include <string>
#include <vector>

namespace tunica {

/// Pixels: libpng makes no longer side.
inline constexpr int longest_png_side = 1'000'000;

/// A PNG of these pixels, rows from the top.
/// @param pixels  width x height x 4: red, green, blue, cover, each 0 to 255
std::string png_of(const std::vector<unsigned char>& pixels, int width, int height);

}  // namespace tunica
