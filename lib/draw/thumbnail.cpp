#include "tunica/draw/thumbnail.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/png.hpp"
#include "tunica/draw/detail/rasteriser.hpp"
#include "tunica/draw/detail/shading.hpp"
#include "tunica/draw/detail/view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tunica {
namespace {

constexpr int thumbnail_oversampling = 2;

Camera camera_for(const std::vector<Vec3>& points, const std::array<Vec3, 3>& axes, int longest) {
  Camera camera{.right = axes[0], .up = axes[1], .towards = axes[2]};
  const Vec2 extent = centre_camera(camera, points);
  camera.scale = longest / std::max(extent.maxCoeff(), 1e-12);
  const auto pixels = [&](double length) { return std::max(1, narrow<int>(std::lround(length * camera.scale))); };
  camera.width = pixels(extent.x()) * thumbnail_oversampling;
  camera.height = pixels(extent.y()) * thumbnail_oversampling;
  camera.scale *= 0.98 * thumbnail_oversampling;  // its outline stays clear of the border
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
  require_drawable(surface, values);
  if (options.longest < 1 || options.longest > longest_png_side) {
    throw InputError(fmt::format("a picture of {} pixels: choose 1 to {}", options.longest, longest_png_side));
  }
  if (!std::ranges::all_of(options.axes, [](const Vec3& axis) { return axis.allFinite(); })) {
    throw InputError("an axis of the picture is not finite");
  }
  const Camera camera = camera_for(surface.vertices, options.axes, options.longest);
  const int width = camera.width / thumbnail_oversampling;
  const int height = camera.height / thumbnail_oversampling;
  const Raster raster = rasterise(surface, shading_normals(surface), values, camera);
  const Paint paint{.top = options.top, .plain = values.empty() || !(options.top > 0)};
  std::vector<unsigned char> pixels;
  pixels.reserve(narrow<std::size_t>(4 * width * height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto pixel = pixel_at(raster, x, y, paint);
      pixels.insert(pixels.end(), pixel.begin(), pixel.end());
    }
  }
  return png_of(pixels, width, height);
}

}  // namespace tunica
