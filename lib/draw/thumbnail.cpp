#include "tunica/draw/thumbnail.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/png.hpp"
#include "tunica/draw/detail/rasteriser.hpp"
#include "tunica/draw/detail/shading.hpp"
#include "tunica/draw/detail/view.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>

namespace tunica {
namespace {

constexpr int thumbnail_oversampling = 2;

// The longest extent level, the shortest towards the viewer; turned and raised a little, so that depth can be seen.
std::array<Vec3, 3> thumbnail_axes(const TriangleMesh& surface) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : surface.vertices) {
    mean += p / real(surface.vertices.size());
  }
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : surface.vertices) {
    spread += (p - mean) * (p - mean).transpose();
  }
  spread.diagonal() += 1e-3 * spread.trace() * Vec3(1, 0, 0.5);  // a round body has no axes: this decides
  const Mat3 axes = Eigen::SelfAdjointEigenSolver<Mat3>(spread).eigenvectors();
  const auto positive = [](Vec3 axis) {
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    return axis[largest] < 0 ? Vec3(-axis) : axis;
  };
  const Vec3 right = positive(axes.col(2));
  const Vec3 up = positive(axes.col(1));
  const Vec3 towards = right.cross(up);
  const Vec3 turned = std::cos(0.4) * towards + std::sin(0.4) * right;
  const Vec3 raised = std::cos(0.25) * turned + std::sin(0.25) * up;
  const Vec3 across = up.cross(turned);
  return {across, raised.cross(across), raised};
}

Camera camera_for(const TriangleMesh& mesh, int width, int height) {
  Camera camera;
  const std::array<Vec3, 3> axes = thumbnail_axes(mesh);
  camera.right = axes[0];
  camera.up = axes[1];
  camera.towards = axes[2];
  const Vec2 extent = centre_camera(camera, mesh.vertices);
  camera.width = width;
  camera.height = height;
  camera.scale = 0.94 * std::min(width / std::max(extent.x(), 1e-12), height / std::max(extent.y(), 1e-12));
  return camera;
}

// Rgb and cover of a pixel of the finished picture: the mean over its part of the raster.
std::array<unsigned char, 4> pixel_at(const Raster& raster, int x, int y, const Paint& paint) {
  std::array<double, 3> sum{};
  int covered = 0;
  for (int dy = 0; dy < thumbnail_oversampling; ++dy) {
    for (int dx = 0; dx < thumbnail_oversampling; ++dx) {
      const std::size_t at = raster.at(x * thumbnail_oversampling + dx, y * thumbnail_oversampling + dy);
      if (raster.depth[at] == Raster::empty) {
        continue;
      }
      const auto colour = surface_colour(paint, raster.value[at]);
      const double light = (0.46 + 0.58 * raster.light[at]) * (raster.inner[at] != 0 ? 0.8 : 1.0);
      for (std::size_t c = 0; c < 3; ++c) {
        sum[c] += light * colour[c];
      }
      ++covered;
    }
  }
  std::array<unsigned char, 4> pixel{};
  for (std::size_t c = 0; c < 3 && covered > 0; ++c) {
    pixel[c] = truncated<unsigned char>(std::clamp(sum[c] / covered, 0.0, 255.0));
  }
  pixel[3] = truncated<unsigned char>(255.0 * covered / (thumbnail_oversampling * thumbnail_oversampling));
  return pixel;
}

}  // namespace

std::string thumbnail(const TriangleMesh& surface, const std::vector<double>& values, const ThumbnailOptions& options) {
  TUNICA_ASSERT(!surface.triangles.empty());
  TUNICA_ASSERT(values.empty() || values.size() == surface.vertices.size());
  const Camera camera =
      camera_for(surface, options.width * thumbnail_oversampling, options.height * thumbnail_oversampling);
  const Raster raster = rasterise(surface, shading_normals(surface), values, camera);
  const Paint paint{.top = options.top, .plain = values.empty() || !(options.top > 0)};
  std::vector<unsigned char> pixels;
  pixels.reserve(narrow<std::size_t>(4 * options.width * options.height));
  for (int y = 0; y < options.height; ++y) {
    for (int x = 0; x < options.width; ++x) {
      const auto pixel = pixel_at(raster, x, y, paint);
      pixels.insert(pixels.end(), pixel.begin(), pixel.end());
    }
  }
  return png_of(pixels, options.width, options.height);
}

}  // namespace tunica
