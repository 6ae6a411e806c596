#pragma once

#include "tunica/draw/detail/canvas.hpp"
#include "tunica/draw/detail/rasteriser.hpp"

#include <array>
#include <span>

/// Rasters as images: colours, light and lines.
namespace tunica {

/// What a picture needs of a mesh: corners that exist, and vertices at finite places, those of no triangle as well,
/// which are in its frame. Errors: InputError.
void require_drawable(const TriangleMesh& mesh);
/// The same, and that there is a triangle, and no value or one per vertex. Errors: InputError.
void require_drawable(const TriangleMesh& surface, std::span<const double> values);

using Palette = std::array<std::array<std::uint8_t, 3>, 256>;

/// From a pale sand over orange and red to a dark violet: lighter is less at every step, also for the colour-blind and
/// in grey, and a surface whose values are small is light enough to show its shape.
const Palette& surface_palette();

struct Paint {
  double top = 0;           ///< value of the palette's last colour; 0: that of the first everywhere
  bool plain = false;       ///< no values: one colour
  bool inside_out = false;  ///< what faces the viewer is the inner side
};

/// Red, green and blue of a value; what is not finite is grey.
std::array<std::uint8_t, 3> surface_colour(const Paint& paint, float value);

/// The raster in colours on white: diffuse light that leaves the hues readable, dark outlines where the depth jumps by
/// more than `jump` (mm).
Image shaded(const Raster& raster, const Paint& paint, double jump);

/// Darkens the image along lines that lie on the surface (within `bias`, mm), hidden where it hides them: the more, the
/// more room is between them; not at all where there is none.
void draw_lines(Image& image, const Raster& raster, const Camera& camera, std::span<const std::array<Vec3, 2>> lines,
                double bias);

/// Draws the border of what `of` covers in grey.
void draw_outline(Image& image, const Raster& of);

}  // namespace tunica
