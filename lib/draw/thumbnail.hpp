#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <array>
#include <string>
#include <vector>

namespace tunica {

struct ThumbnailOptions {
  int longest = 240;  ///< pixels, its longer side
  double top = 0;     ///< value of the last colour; 0: the surface is plain
  std::array<Vec3, 3> axes{Vec3::UnitX(), Vec3::UnitZ(), -Vec3::UnitY()};  ///< as of picture_axes()
};

/// A surface alone, in the colours of surface_picture(), on nothing: a PNG that stands on a light page and on a dark
/// one. The organ fills the picture. The same input gives the same bytes whatever the number of threads.
/// Errors: InputError as surface_picture(), and no pixels, more than a PNG's side has, axes that are not finite.
/// @param surface  at least one triangle, finite positions, mm
/// @param values   empty, or #V values >= 0; what is not finite is drawn grey
std::string thumbnail(const TriangleMesh& surface, const std::vector<double>& values, const ThumbnailOptions& options);

}  // namespace tunica
