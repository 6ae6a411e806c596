#include "tunica/draw/detail/shading.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

using Bytes = std::array<std::uint8_t, 3>;

constexpr Bytes plain_colour{196, 202, 208};
constexpr Bytes no_value{150, 163, 178};

// Evenly spaced; lightness falls from 93 to 25 of 100, by about the same from each to the next.
constexpr std::array<Bytes, 8> control_colours{Bytes{243, 235, 219}, {251, 214, 162}, {253, 183, 116}, {250, 144, 94},
                                               {235, 100, 92},       {204, 66, 104},  {154, 45, 119},  {88, 27, 110}};

std::uint8_t byte_of(double value) { return truncated<std::uint8_t>(std::clamp(std::round(value), 0.0, 255.0)); }

Bytes blend(const Bytes& a, const Bytes& b, double part) {
  Bytes colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    colour[c] = byte_of((1 - part) * a[c] + part * b[c]);
  }
  return colour;
}

bool is_inside(const Raster& raster, int x, int y) { return x >= 0 && y >= 0 && x < raster.width && y < raster.height; }

// Whether the surface ends here before another one, or before none: the depth jumps by more than `step`, and by far
// more than on the other side, where a surface that is seen from near its edge only slopes.
bool on_outline(const Raster& raster, int x, int y, float step) {
  constexpr float steepening = 4;
  const float own = raster.depth[raster.at(x, y)];
  const auto drop = [&](int dx, int dy) {
    return is_inside(raster, x + dx, y + dy) ? own - raster.depth[raster.at(x + dx, y + dy)] : 0;
  };
  for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    const float here = drop(dx, dy);
    const float behind = std::abs(drop(-dx, -dy));
    if (here > step && (std::isinf(here) || std::isinf(behind) || here > steepening * behind)) {
      return true;
    }
  }
  return false;
}

template <typename Change>
void change_pixel(Image& image, std::size_t at, const Change& change) {
  for (std::size_t c = 0; c < 3; ++c) {
    std::uint8_t& byte = image.bytes[3 * at + c];
    byte = byte_of(change(byte));
  }
}

// Pixels that the lines pass and the surface does not hide; the length of all that is seen, in pixels.
double cover_lines(std::vector<std::uint8_t>& cover, const Raster& raster, const Camera& camera,
                   std::span<const std::array<Vec3, 2>> lines, double bias) {
  double seen = 0;
  for (const auto& line : lines) {
    const Vec3 from = camera.project(line[0]);
    const Vec3 to = camera.project(line[1]);
    const double length = (to - from).head<2>().norm();
    if (!(length < 1e5)) {
      continue;
    }
    const int steps = truncated<int>(std::ceil(2 * length)) + 1;
    for (int i = 0; i <= steps; ++i) {
      const Vec3 p = from + (to - from) * (real(i) / steps);
      bool touches = false;
      // A pen of 2 x 2 pixels: one pixel in the finished picture.
      for (const auto& [dx, dy] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {-0.5, 0.5}, {0.5, 0.5}}) {
        const double x = std::floor(p.x() + dx);
        const double y = std::floor(p.y() + dy);
        if (!(x >= 0 && y >= 0 && x < raster.width && y < raster.height)) {
          continue;
        }
        const std::size_t at = raster.at(truncated<int>(x), truncated<int>(y));
        if (raster.depth[at] != Raster::empty && p.z() > raster.depth[at] - bias) {
          cover[at] = 1;
          touches = true;
        }
      }
      seen += touches ? length / steps : 0;
    }
  }
  return seen;
}

}  // namespace

void require_drawable(const TriangleMesh& mesh) {
  require_corners(mesh.vertices.size(), mesh.triangles);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (!std::isfinite(mesh.vertices[v].squaredNorm())) {
      throw InputError(fmt::format("vertex {} is not at a finite place, or too far out to be drawn", v));
    }
  }
}

void require_drawable(const TriangleMesh& surface, std::span<const double> values) {
  require_drawable(surface);
  if (surface.triangles.empty()) {
    throw InputError("a surface without triangles cannot be drawn");
  }
  if (!values.empty() && values.size() != surface.vertices.size()) {
    throw InputError(
        fmt::format("{} values for {} vertices: give one for each, or none", values.size(), surface.vertices.size()));
  }
}

std::span<const Bytes> surface_colours() { return control_colours; }

const Palette& surface_palette() {
  static const Palette colours = [] {
    Palette made;
    for (std::size_t i = 0; i < made.size(); ++i) {
      const double place = real(i) / 255 * real(control_colours.size() - 1);
      const auto before = std::min(truncated<std::size_t>(place), control_colours.size() - 2);
      made[i] = blend(control_colours[before], control_colours[before + 1], place - real(before));
    }
    return made;
  }();
  return colours;
}

Bytes surface_colour(const Paint& paint, float value) {
  if (paint.plain && std::isfinite(value)) {
    return plain_colour;
  }
  if (!std::isfinite(value)) {
    return no_value;
  }
  const double level = paint.top > 0 ? 255 * value / paint.top : 0;
  return surface_palette()[truncated<std::size_t>(std::round(std::clamp(level, 0.0, 255.0)))];
}

Image shaded(const Raster& raster, const Paint& paint, double jump) {
  Image image{raster.width, raster.height, std::vector<std::uint8_t>(3 * raster.depth.size(), 255)};
  parallel_for_blocks(narrow<std::size_t>(raster.height), 64, [&](std::size_t begin, std::size_t end) {
    for (int y = narrow<int>(begin); y < narrow<int>(end); ++y) {
      for (int x = 0; x < raster.width; ++x) {
        const std::size_t at = raster.at(x, y);
        if (raster.depth[at] == Raster::empty) {
          continue;
        }
        double light = 0.52 + 0.52 * raster.light[at];
        if ((raster.inner[at] != 0) != paint.inside_out) {
          light *= 0.75;
        }
        if (on_outline(raster, x, y, static_cast<float>(jump))) {
          light *= 0.35;
        }
        const Bytes colour = surface_colour(paint, raster.value[at]);
        for (std::size_t c = 0; c < 3; ++c) {
          image.bytes[3 * at + c] = byte_of(light * colour[c]);
        }
      }
    }
  });
  return image;
}

void draw_lines(Image& image, const Raster& raster, const Camera& camera, std::span<const std::array<Vec3, 2>> lines,
                double bias) {
  std::vector<std::uint8_t> cover(raster.depth.size(), 0);
  const double length = cover_lines(cover, raster, camera, lines, bias);
  const auto covered = std::ranges::count_if(raster.depth, [](float depth) { return depth != Raster::empty; });
  // Pixels between them: from 20 on, ten in the finished picture, they do not hide the colours.
  const double room = 2 * real(covered) / std::max(length, 1.0);
  const double strength = 0.6 * std::clamp((room - 6) / 30, 0.0, 1.0);
  for (std::size_t at = 0; at < cover.size(); ++at) {
    if (cover[at] != 0) {
      change_pixel(image, at, [&](double byte) { return (1 - strength) * byte; });
    }
  }
}

void draw_outline(Image& image, const Raster& of) {
  constexpr int pen = 3;  // pixels
  constexpr double grey = 110;
  const auto covers = [&](int x, int y) { return is_inside(of, x, y) && of.depth[of.at(x, y)] != Raster::empty; };
  for (int y = 0; y < of.height; ++y) {
    for (int x = 0; x < of.width; ++x) {
      if (covers(x, y) && !(covers(x - pen, y) && covers(x + pen, y) && covers(x, y - pen) && covers(x, y + pen))) {
        change_pixel(image, of.at(x, y), [&](double byte) { return 0.3 * byte + 0.7 * grey; });
      }
    }
  }
}

}  // namespace tunica
