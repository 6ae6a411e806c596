#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

struct PictureOptions {
  std::string title = {};               ///< empty: none; the largest value is added by error_map_picture
  std::string caption = {};             ///< a second, smaller line below the title
  std::string quantity = "distance";    ///< what the colours stand for, above the colour bar
  std::optional<double> maximum = {};   ///< mm, the top of the colour bar; none: the largest value
  std::optional<double> diagonal = {};  ///< mm, > 0; gives the colour bar a second scale in percent of it
  std::vector<std::array<Vec3, 2>> lines =
      {};  ///< mm, segments on the surface drawn dark, e.g. the edges of the shells
};

/// Draws a surface, coloured by a value per vertex, from two opposite sides, with a colour bar. @return a PNG of 1600 x
/// 900. The longest extent, the direction of view and the arrangement of the two views follow from the principal axes;
/// the side with the largest value is drawn first, with a ring around that place. The same input gives the same bytes
/// whatever the number of threads.
/// @param surface    at least one triangle, finite positions, mm
/// @param values_mm  #V values >= 0, mm; what is not finite is drawn grey and does not count
/// Cost: 20,000 triangles in about 0.1 s.
/// Limits: a pocket that neither side shows stays hidden; text other than ASCII is drawn as "?".
std::string error_map_picture(const TriangleMesh& surface, const std::vector<double>& values_mm,
                              const PictureOptions& options);

/// The same two views of a plain surface without values: title, caption and lines of `options` are used.
std::string surface_picture(const TriangleMesh& surface, const PictureOptions& options);

/// The colour of a value in the pictures: red, green, blue in sRGB, 0 to 1.
/// @param part  of the largest value, 0 to 1; grey where it is no number
std::array<double, 3> bar_colour(double part);

}  // namespace tunica
