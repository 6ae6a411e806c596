#include "tunica/draw/picture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/draw/detail/canvas.hpp"
#include "tunica/draw/detail/shading.hpp"
#include "tunica/draw/detail/svg_text.hpp"
#include "tunica/draw/detail/ticks.hpp"
#include "tunica/draw/detail/view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace tunica {
namespace {

constexpr int picture_width = 1600;
constexpr int picture_height = 900;
// Surfaces are drawn twice as large and averaged down: smooth edges and lines.
constexpr int oversampling = 2;
constexpr int most_ticks = 6;
constexpr double rounding = 1e-6;  // values may have been floats
// Sizes of letters: the smallest are still read in a picture of half the size.
constexpr double heading_size = 34, caption_size = 25, letter_size = 24;

constexpr Colour black{0.1, 0.1, 0.1};
constexpr Colour grey{0.36, 0.36, 0.36};
constexpr Colour white{1, 1, 1};
constexpr Colour ring_colour{0.05, 0.35, 0.75};
constexpr Colour outline_colour{0.43, 0.43, 0.43};

Colour colour_of(std::size_t level) {
  const auto& [red, green, blue] = surface_palette()[level];
  return {red / 255.0, green / 255.0, blue / 255.0};
}

std::vector<Index> used_vertices(const TriangleMesh& mesh) {
  std::vector<char> seen(mesh.vertices.size(), 0);
  for (const auto& triangle : mesh.triangles) {
    for (const Index v : triangle) {
      seen[v] = 1;
    }
  }
  std::vector<Index> used;
  for (std::size_t v = 0; v < seen.size(); ++v) {
    if (seen[v] != 0) {
      used.push_back(narrow<Index>(v));
    }
  }
  return used;
}

// A surface whose faces point inward: its signed volume about the mean of its vertices is negative.
bool turned_inside_out(const TriangleMesh& mesh, const std::vector<Index>& used) {
  Vec3 origin = Vec3::Zero();
  for (const Index v : used) {
    origin += mesh.vertices[v] / real(used.size());
  }
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += (mesh.vertices[a] - origin).dot((mesh.vertices[b] - origin).cross(mesh.vertices[c] - origin));
  }
  return volume < 0;
}

/// What is drawn, once per view.
struct Shown {
  const TriangleMesh* surface;
  const std::vector<double>* values;
  std::span<const std::array<Vec3, 2>> lines;
  const TriangleMesh* others;
  const TriangleMesh* outline;  // or none
  std::string when = {};
  std::vector<View> views = {};
};

// What the views are fitted to. Other bodies may be far larger than the surface: they are cut at half its size around.
std::vector<Vec3> points_to_see(const std::vector<Shown>& shown, const std::optional<PictureCut>& cut) {
  std::vector<Vec3> points;
  const auto add = [&](const Vec3& p) {
    if (!cut || cut->beyond(p) <= 0) {
      points.push_back(p);
    }
  };
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const Shown& one : shown) {
    for (const Index v : used_vertices(*one.surface)) {
      const Vec3& p = one.surface->vertices[v];
      add(p);
      lower = lower.cwiseMin(p);
      upper = upper.cwiseMax(p);
    }
  }
  const Vec3 around = Vec3::Constant(0.5 * (upper - lower).maxCoeff());
  for (const Shown& one : shown) {
    for (const TriangleMesh* mesh : {one.others, one.outline}) {
      if (mesh != nullptr) {
        for (const Vec3& vertex : mesh->vertices) {
          add(vertex.cwiseMax(lower - around).cwiseMin(upper + around));
        }
      }
    }
  }
  return points.empty() ? std::vector<Vec3>{lower, upper} : points;
}

// What of lines is not cut away.
std::vector<std::array<Vec3, 2>> cut_lines(std::span<const std::array<Vec3, 2>> lines,
                                           const std::optional<PictureCut>& cut) {
  std::vector<std::array<Vec3, 2>> left;
  for (auto [from, to] : lines) {
    double at_from = cut ? cut->beyond(from) : 0, at_to = cut ? cut->beyond(to) : 0;
    if (at_from > at_to) {
      std::swap(from, to);
      std::swap(at_from, at_to);
    }
    if (at_from <= 0) {
      left.push_back({from, at_to > 0 ? Vec3(from + at_from / (at_from - at_to) * (to - from)) : to});
    }
  }
  return left;
}

/// The picture that is being drawn.
class PictureDrawing {
public:
  PictureDrawing(std::vector<Shown> shown, const PictureOptions& options)
      : shown_(std::move(shown)), options_(options), canvas_(picture_width, picture_height) {
    for (const Shown& one : shown_) {
      const std::vector<double>& values = *one.values;
      for (const Index v : used_vertices(*one.surface)) {
        if (!values.empty() && std::isfinite(values[v]) && (worst_ == nullptr || values[v] > largest_)) {
          worst_ = &one;
          worst_at_ = one.surface->vertices[v];
          largest_ = values[v];
        }
      }
    }
    largest_ = std::max(0.0, largest_);
    const TriangleMesh& first = *shown_.front().surface;
    paint_.plain = shown_.front().values->empty();
    paint_.inside_out = turned_inside_out(first, used_vertices(first));
    const double step = round_step(0, largest_, most_ticks);
    paint_.top = options.maximum.value_or(step > 0 ? std::ceil(largest_ / step - rounding) * step : largest_);
    const bool headed = !options.title.empty() || !options.caption.empty();
    box_ = {36, headed ? 120.0 : 36.0, paint_.plain ? picture_width - 36.0 : 1310.0, picture_height - 66.0};
  }

  /// One thing from two opposite sides.
  void look_from_both_sides() {
    const auto views = opposite_views(points_to_see(shown_, {}), box_, oversampling);
    shown_.front().views = {views.begin(), views.end()};
  }

  void look_at_moments(const std::optional<PictureCut>& cut) {
    const auto views = views_of_moments(points_to_see(shown_, cut), shown_.size(), cut, box_, oversampling);
    for (std::size_t i = 0; i < views.size(); ++i) {
      shown_[i].views = {views[i]};
    }
  }

  std::string png() {
    for (const Shown& one : shown_) {
      draw(one);
    }
    draw_legend();
    if (!paint_.plain) {
      draw_colour_bar();
    }
    canvas_.fitted_text(options_.title, 40, 58, heading_size, picture_width - 80, black);
    canvas_.fitted_text(options_.caption, 40, 98, caption_size, picture_width - 80, grey);
    return canvas_.png();
  }

private:
  void draw(const Shown& one) {
    TriangleMesh all = *one.surface;
    const auto first = narrow<Index>(all.vertices.size());
    all.vertices.insert(all.vertices.end(), one.others->vertices.begin(), one.others->vertices.end());
    for (const auto& [a, b, c] : one.others->triangles) {
      all.triangles.push_back({first + a, first + b, first + c});
    }
    std::vector<double> values = one.values->empty() ? std::vector<double>(first, 0) : *one.values;
    values.resize(all.vertices.size(), std::nan(""));
    const auto normals = shading_normals(all);
    const bool is_outlined = one.outline != nullptr && !one.outline->triangles.empty();
    const auto normals_of_outline = is_outlined ? shading_normals(*one.outline) : decltype(normals)();
    for (const View& view : one.views) {
      const Camera& camera = view.camera;
      const double pixel = 1 / camera.scale;
      const Raster raster = rasterise(all, normals, values, camera, one.surface->triangles.size());
      Image image = shaded(raster, paint_, 14 * pixel);
      draw_lines(image, raster, camera, cut_lines(one.lines, camera.cut), 4 * pixel);
      if (is_outlined) {
        draw_outline(image, rasterise(*one.outline, normals_of_outline, {}, camera));
      }
      const Box2& panel = view.panel;
      canvas_.halved_image(image, truncated<int>(std::round(panel.left)), truncated<int>(std::round(panel.top)));
      if (has_largest() && worst_ == &one) {
        ring_largest(view, raster, 6 * pixel);
      }
      draw_axes(view);
      canvas_.text(one.when, (panel.left + panel.right) / 2, panel.bottom + 34, letter_size, black, Align::centre);
    }
  }

  [[nodiscard]] bool has_largest() const { return worst_ != nullptr && largest_ > 0; }

  void ring(double x, double y) {
    canvas_.circle(x, y, 13, 6, white);
    canvas_.circle(x, y, 13, 3, ring_colour);
  }

  // In a view that shows the place.
  void ring_largest(const View& view, const Raster& raster, double tolerance) {
    if (view.camera.cut && view.camera.cut->beyond(worst_at_) > 0) {
      return;
    }
    const Vec3 seen = view.camera.project(worst_at_);
    const auto pixel = [](double place, int size) {
      return truncated<int>(std::clamp(std::floor(place), 0.0, real(size - 1)));
    };
    if (seen.z() < raster.depth[raster.at(pixel(seen.x(), raster.width), pixel(seen.y(), raster.height))] - tolerance) {
      return;
    }
    ringed_ = true;
    ring(view.panel.left + seen.x() / oversampling, view.panel.top + seen.y() / oversampling);
  }

  // The axes of the mesh's own frame as this camera sees them, the ones that point away first.
  void draw_axes(const View& view) {
    constexpr double length = 30;
    const double x = view.panel.left + 40;
    const double y = view.panel.bottom - 40;
    std::array<int, 3> order{0, 1, 2};
    std::ranges::sort(order, [&](int i, int j) { return view.camera.towards[i] < view.camera.towards[j]; });
    for (const int i : order) {
      const double dx = length * view.camera.right[i];
      const double dy = -length * view.camera.up[i];
      canvas_.line(x, y, x + dx, y + dy, 2, grey);
      const double reach = std::hypot(dx, dy);
      if (reach > 0.3 * length) {
        const double away = (reach + 12) / reach;
        canvas_.text(options_.axes.substr(i, 1), x + away * dx, y + away * dy + 7, letter_size, grey, Align::centre);
      }
    }
  }

  [[nodiscard]] std::string with_unit(double value) const {
    std::string text = fmt::format("{} {}", short_number(value), options_.unit);
    if (options_.diagonal) {
      text += fmt::format(" ({} % of the diagonal)", short_number(100 * value / *options_.diagonal));
    }
    return text;
  }

  // In one line below the views: a length, and what ring, line and grey are.
  void draw_legend() {
    constexpr double gap = 44;
    const double base = picture_height - 20;
    const double middle = base - 8;
    const double pixels_per_mm = shown_[0].views[0].camera.scale / oversampling;
    const double length = round_below(200 / pixels_per_mm);
    double x = box_.left + 4;
    const auto tell = [&](const std::string& text) {
      canvas_.text(text, x + 12, base, letter_size, black);
      x += 12 + text_width(text, letter_size) + gap;
    };
    const double width = length * pixels_per_mm;
    canvas_.line(x, middle, x + width, middle, 3, black);
    canvas_.line(x + 1, middle - 7, x + 1, middle + 7, 2, black);
    canvas_.line(x + width - 1, middle - 7, x + width - 1, middle + 7, 2, black);
    x += width;
    tell(fmt::format("{} mm", short_number(length)));
    if (has_largest()) {
      ring(x + 13, middle);
      x += 26;
      tell("largest: " + with_unit(largest_) + (ringed_ ? "" : ", out of sight"));
    }
    if (shown_[0].outline != nullptr && !shown_[0].outline->triangles.empty()) {
      canvas_.line(x, middle, x + 36, middle, 3, outline_colour);
      x += 36;
      tell(options_.outline_name);
    }
  }

  [[nodiscard]] double place_on_bar(double part) const { return bar_bottom + (bar_top - bar_bottom) * part; }

  void draw_scale(double top, double x, double side, const Colour& colour) {
    const double step = round_step(0, top, most_ticks);
    for (const double tick : multiples(0, top, step)) {
      const double y = place_on_bar(top > 0 ? tick / top : 0);
      canvas_.line(x, y, x + 8 * side, y, 1.5, colour);
      canvas_.text(tick == 0 ? "0" : tick_text(tick, step), x + 14 * side, y + 8, letter_size, colour,
                   side > 0 ? Align::left : Align::right);
    }
  }

  void draw_colour_bar() {
    const double middle = (bar_left + bar_right) / 2;
    constexpr double room = 250;
    const std::vector<std::string> lines = wrapped(options_.quantity, room, letter_size);
    double y = bar_top - (options_.diagonal ? 88 : 60) - 28 * real(lines.size());
    for (const std::string& line : lines) {
      const double half = text_width(line, letter_size) / 2;
      canvas_.text(line, std::min(middle, picture_width - 12 - half), y += 28, letter_size, black, Align::centre);
    }
    for (int i = 0; i < 256; ++i) {
      canvas_.rectangle(bar_left, std::floor(place_on_bar((i + 1) / 256.0)), bar_right,
                        std::floor(place_on_bar(i / 256.0)) + (i == 0 ? 0 : 1), colour_of(i));
    }
    canvas_.text(options_.unit, bar_right + 14, bar_top - 30, letter_size, black);
    draw_scale(paint_.top, bar_right, 1, black);
    if (options_.diagonal) {
      canvas_.text("% of", bar_left - 14, bar_top - 54, letter_size, grey, Align::right);
      canvas_.text("diagonal", bar_left - 14, bar_top - 28, letter_size, grey, Align::right);
      draw_scale(100 * paint_.top / *options_.diagonal, bar_left, -1, grey);
    }
    if (largest_ > paint_.top * (1 + rounding)) {  // the bar goes on
      canvas_.triangle(bar_left, bar_top - 3, bar_right, bar_top - 3, middle, bar_top - 24, colour_of(255));
    }
  }

  static constexpr double bar_left = 1432, bar_right = 1466, bar_top = 250, bar_bottom = 820;

  std::vector<Shown> shown_;
  const PictureOptions& options_;
  Canvas canvas_;
  const Shown* worst_ = nullptr;  ///< what has the largest value
  Vec3 worst_at_ = Vec3::Zero();
  double largest_ = 0;
  bool ringed_ = false;  ///< one of the views shows it
  Paint paint_;
  Box2 box_;
};

void require_drawable(const std::vector<std::array<Vec3, 2>>& lines) {
  for (const auto& [from, to] : lines) {
    if (!from.allFinite() || !to.allFinite()) {
      throw InputError("a line of the picture has an end that is not finite");
    }
  }
}

void require_valid(const PictureOptions& options) {
  if (options.diagonal) {
    require_positive(*options.diagonal, "the diagonal");
  }
  if (options.maximum) {
    require_positive(*options.maximum, "the top of the colour bar");
  }
}

}  // namespace

std::string surface_picture(const TriangleMesh& surface, const std::vector<double>& values,
                            const PictureOptions& options) {
  require_drawable(surface, values);
  require_drawable(options.others);
  require_drawable(options.outline);
  require_drawable(options.lines);
  require_valid(options);
  PictureDrawing drawing({{&surface, &values, options.lines, &options.others, &options.outline}}, options);
  drawing.look_from_both_sides();
  return drawing.png();
}

std::string moments_picture(const std::vector<PictureMoment>& moments, const PictureOptions& options,
                            const std::optional<PictureCut>& cut) {
  if (moments.empty()) {
    throw InputError("a picture of moments needs one at least");
  }
  if (cut && !(is_unit(cut->normal) && std::isfinite(cut->offset))) {
    throw InputError("the normal of a cut is no unit vector, or its place not finite");
  }
  require_valid(options);
  std::vector<Shown> shown;
  for (const PictureMoment& moment : moments) {
    require_drawable(moment.surface, moment.values);
    require_drawable(moment.others);
    require_drawable(moment.lines);
    shown.push_back({&moment.surface, &moment.values, moment.lines, &moment.others, nullptr, moment.when});
  }
  PictureDrawing drawing(std::move(shown), options);
  drawing.look_at_moments(cut);
  return drawing.png();
}

std::array<double, 3> bar_colour(double part) {
  const auto colour = surface_colour({.top = 1}, static_cast<float>(part));
  return {colour[0] / 255.0, colour[1] / 255.0, colour[2] / 255.0};
}

}  // namespace tunica
