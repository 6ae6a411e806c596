#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <array>
#include <vector>

namespace tunica {

/// What a viewer needs to show a surface smooth and coloured.
struct ShadedSurface {
  std::vector<Vec3> normals;                   ///< #V, unit: of the triangles around, weighted by their area
  std::vector<std::array<double, 3>> colours;  ///< #V, as bar_colour(), from 0 to the largest value
  double largest = 0;                          ///< value that is finite
};

/// Errors: InputError as surface_picture(). @param values  #V, >= 0; what is not finite is grey
ShadedSurface shaded_surface(const TriangleMesh& mesh, const std::vector<double>& values);

}  // namespace tunica
