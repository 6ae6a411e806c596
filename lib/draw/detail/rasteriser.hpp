#pragma once

#include "tunica/core/narrow.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <limits>
#include <optional>
#include <vector>

/// A software rasteriser: triangles to layers of depth, value and light, without a window system.
namespace tunica {

/// An orthographic camera. A point p falls on pixel (x, y) = (width / 2 + scale (right . (p - centre)),
/// height / 2 - scale (up . (p - centre))); what is larger along `towards` hides what is smaller.
struct Camera {
  Vec3 right = Vec3::UnitX();
  Vec3 up = Vec3::UnitZ();
  Vec3 towards = -Vec3::UnitY();  ///< from the surface to the viewer
  Vec3 centre = Vec3::Zero();     ///< mm
  double scale = 1;               ///< pixels per mm
  int width = 0;                  ///< pixels
  int height = 0;
  std::optional<PictureCut> cut = {};

  /// (x in pixels, y in pixels downward, depth towards the viewer in mm).
  [[nodiscard]] Vec3 project(const Vec3& point) const;
};

/// What the camera sees, a value per pixel in rows from the top. `depth` is -infinity where there is no surface.
struct Raster {
  static constexpr float empty = -std::numeric_limits<float>::infinity();
  int width = 0;
  int height = 0;
  std::vector<float> depth;          ///< mm towards the viewer
  std::vector<float> value;          ///< interpolated vertex value; NaN where a corner of the triangle has none
  std::vector<float> light;          ///< 0 dark … 1 lit
  std::vector<unsigned char> inner;  ///< 1 where the back of a triangle is seen

  [[nodiscard]] std::size_t at(int x, int y) const {
    return narrow<std::size_t>(y) * narrow<std::size_t>(width) + narrow<std::size_t>(x);
  }
};

/// Unit normals at the corners of each triangle: area-weighted means over the faces around the vertex that make less
/// than 40 degrees with the triangle, so that smooth parts look smooth and sharp edges stay sharp.
/// @return #F by 3 unit vectors; a degenerate triangle gets its vertices' means, or z.
std::vector<std::array<Vec3, 3>> shading_normals(const TriangleMesh& mesh);

/// Draws `mesh` as `camera` sees it, by rows in parallel; the result does not depend on the number of threads.
/// @param normals  #F, of shading_normals()
/// @param values   empty, or #V
/// @param one_sided_from  triangles from this on are not there where their back is seen
Raster rasterise(const TriangleMesh& mesh, const std::vector<std::array<Vec3, 3>>& normals,
                 const std::vector<double>& values, const Camera& camera,
                 std::size_t one_sided_from = std::numeric_limits<std::size_t>::max());

}  // namespace tunica
