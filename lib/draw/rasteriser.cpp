#include "tunica/draw/detail/rasteriser.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

// Light from the upper left behind the viewer, in the camera's axes (right, up, towards).
const Vec3 light_direction = Vec3(-0.3, 0.4, 0.87).normalized();

struct ProjectedTriangle {
  std::array<Vec3, 3> corner;  // pixels, pixels, mm
  double area = 0;             // twice, signed: negative when the back is seen
  bool seen = false;
};

double twice_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

ProjectedTriangle project_triangle(const TriangleMesh& mesh, std::size_t triangle, const Camera& camera,
                                   bool one_sided) {
  ProjectedTriangle projected;
  for (std::size_t i = 0; i < 3; ++i) {
    projected.corner[i] = camera.project(mesh.vertices[mesh.triangles[triangle][i]]);
  }
  // Rows grow downward, so a triangle that faces the viewer turns the other way round.
  projected.area = -twice_area(projected.corner[0], projected.corner[1], projected.corner[2]);
  projected.seen = (one_sided ? projected.area > 0 : projected.area != 0) && std::isfinite(projected.area);
  return projected;
}

// Pixels whose centres may lie within [low, high], clipped to [first, last).
std::pair<int, int> pixel_range(double low, double high, int first, int last) {
  const double from = std::clamp(std::ceil(low - 0.5), real(first), real(last));
  const double to = std::clamp(std::floor(high - 0.5) + 1, real(first), real(last));
  return {truncated<int>(from), truncated<int>(to)};
}

/// What is interpolated over a triangle.
struct AtCorners {
  std::array<Vec3, 3> normal;  // in the camera's axes
  std::array<double, 3> value{};
  std::array<double, 3> beyond{};  // the camera's cut, mm: above zero is not drawn
};

void draw_triangle(Raster& raster, const ProjectedTriangle& triangle, const AtCorners& at_corners, int first_row,
                   int last_row) {
  const auto& [normal, value, beyond] = at_corners;
  const auto& [a, b, c] = triangle.corner;
  const auto [top, bottom] =
      pixel_range(std::min({a.y(), b.y(), c.y()}), std::max({a.y(), b.y(), c.y()}), first_row, last_row);
  const auto [left, right] =
      pixel_range(std::min({a.x(), b.x(), c.x()}), std::max({a.x(), b.x(), c.x()}), 0, raster.width);
  const double inverse = 1 / twice_area(a, b, c);
  const double side = triangle.area > 0 ? 1 : -1;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const Vec3 pixel(x + 0.5, y + 0.5, 0);
      const double wa = twice_area(pixel, b, c) * inverse;
      const double wb = twice_area(a, pixel, c) * inverse;
      const double wc = 1 - wa - wb;
      // Borders belong to both neighbours: no crack between them.
      if (wa < 0 || wb < 0 || wc < -1e-12) {
        continue;
      }
      if (wa * beyond[0] + wb * beyond[1] + wc * beyond[2] > 0) {
        continue;
      }
      const std::size_t at = raster.at(x, y);
      const auto depth = static_cast<float>(wa * a.z() + wb * b.z() + wc * c.z());
      if (!(depth > raster.depth[at])) {
        continue;
      }
      const Vec3 direction = wa * normal[0] + wb * normal[1] + wc * normal[2];
      const double length = direction.norm();
      // A little light reaches round the corner: the terminator of a plain cosine hides the colours behind it.
      const double cosine = length > 0 ? side * direction.dot(light_direction) / length : 0;
      const double lit = (cosine + 0.4) / 1.4;
      raster.depth[at] = depth;
      raster.light[at] = static_cast<float>(std::clamp(lit, 0.0, 1.0));
      raster.value[at] = static_cast<float>(wa * value[0] + wb * value[1] + wc * value[2]);
      raster.inner[at] = side < 0 ? 1 : 0;
    }
  }
}

}  // namespace

Vec3 Camera::project(const Vec3& point) const {
  const Vec3 from = point - centre;
  return {0.5 * width + scale * right.dot(from), 0.5 * height - scale * up.dot(from), towards.dot(from)};
}

std::vector<std::array<Vec3, 3>> shading_normals(const TriangleMesh& mesh) {
  const std::size_t count = mesh.triangles.size();
  std::vector<Vec3> face(count);
  std::vector<std::size_t> start(mesh.vertices.size() + 1, 0);
  for (std::size_t t = 0; t < count; ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    face[t] = (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    for (const Index v : mesh.triangles[t]) {
      ++start[v + 1];
    }
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    start[v + 1] += start[v];
  }
  std::vector<Index> around(3 * count);
  std::vector<std::size_t> next(start.begin(), start.end() - 1);
  for (std::size_t t = 0; t < count; ++t) {
    for (const Index v : mesh.triangles[t]) {
      around[next[v]++] = narrow<Index>(t);
    }
  }
  const double crease = std::cos(40 * std::acos(-1.0) / 180);
  std::vector<std::array<Vec3, 3>> normals(count);
  parallel_for_blocks(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const double own = face[t].norm();
      for (std::size_t i = 0; i < 3; ++i) {
        const Index v = mesh.triangles[t][i];
        Vec3 sum = Vec3::Zero();
        for (std::size_t k = start[v]; k < start[v + 1]; ++k) {
          const Vec3& other = face[around[k]];
          if (own == 0 || other.dot(face[t]) >= crease * own * other.norm()) {
            sum += other;
          }
        }
        const double length = sum.norm();
        normals[t][i] = length > 0 ? Vec3(sum / length) : Vec3(Vec3::UnitZ());
      }
    }
  });
  return normals;
}

Raster rasterise(const TriangleMesh& mesh, const std::vector<std::array<Vec3, 3>>& normals,
                 const std::vector<double>& values, const Camera& camera, std::size_t one_sided_from) {
  TUNICA_ASSERT(camera.width > 0 && camera.height > 0);
  TUNICA_ASSERT(normals.size() == mesh.triangles.size());
  TUNICA_ASSERT(values.empty() || values.size() == mesh.vertices.size());
  const std::size_t rows = camera.height;
  const std::size_t pixels = rows * narrow<std::size_t>(camera.width);
  const std::size_t count = mesh.triangles.size();
  Raster raster;
  raster.width = camera.width;
  raster.height = camera.height;
  raster.depth.assign(pixels, Raster::empty);
  raster.value.assign(pixels, 0);
  raster.light.assign(pixels, 0);
  raster.inner.assign(pixels, 0);

  std::vector<ProjectedTriangle> projected(count);
  parallel_for_blocks(count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      projected[t] = project_triangle(mesh, t, camera, t >= one_sided_from);
    }
  });
  Mat3 to_camera;
  to_camera << camera.right.transpose(), camera.up.transpose(), camera.towards.transpose();

  // Each block owns its rows and takes the triangles in their order: the same picture whatever the number of threads.
  parallel_for_blocks(rows, 64, [&](std::size_t begin, std::size_t end) {
    const int first = narrow<int>(begin);
    const int last = narrow<int>(end);
    for (std::size_t t = 0; t < count; ++t) {
      const auto& corner = projected[t].corner;
      const double top = std::min({corner[0].y(), corner[1].y(), corner[2].y()});
      const double bottom = std::max({corner[0].y(), corner[1].y(), corner[2].y()});
      if (!projected[t].seen || bottom < first || top > last) {
        continue;
      }
      AtCorners at;
      for (std::size_t i = 0; i < 3; ++i) {
        const Index v = mesh.triangles[t][i];
        at.normal[i] = to_camera * normals[t][i];
        at.value[i] = values.empty() ? 0 : values[v];
        if (camera.cut && t < one_sided_from) {
          at.beyond[i] = camera.cut->beyond(mesh.vertices[v]);
        }
      }
      draw_triangle(raster, projected[t], at, first, last);
    }
  });
  return raster;
}

}  // namespace tunica
