#include "tunica/draw/shaded_surface.hpp"

#include "tunica/draw/detail/shading.hpp"
#include "tunica/draw/picture.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {

ShadedSurface shaded_surface(const TriangleMesh& mesh, const std::vector<double>& values) {
  require_drawable(mesh, values);
  ShadedSurface shaded;
  shaded.normals.assign(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3& a = mesh.vertices[t[0]];
    const Vec3 twice = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    for (const Index corner : t) {
      shaded.normals[corner] += twice;
    }
  }
  for (Vec3& normal : shaded.normals) {
    normal.stableNormalize();
  }
  for (const double value : values) {
    shaded.largest = std::isfinite(value) ? std::max(shaded.largest, value) : shaded.largest;
  }
  for (const double value : values) {
    shaded.colours.push_back(bar_colour(shaded.largest > 0 ? value / shaded.largest : 0));
  }
  return shaded;
}

}  // namespace tunica
