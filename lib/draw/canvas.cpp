#include "tunica/draw/detail/canvas.hpp"

#include "tunica/core/error.hpp"
#include "tunica/draw/detail/svg_text.hpp"
#include "tunica/draw/font_bytes.hpp"

#include <cairo-ft.h>
#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <new>
#include <numbers>

namespace tunica {
namespace {

// One for the process: cairo keeps glyphs of a face beyond the last canvas.
cairo_font_face_t* font_face() {
  static cairo_font_face_t* const face = [] {
    FT_Library library = nullptr;
    FT_Face font = nullptr;
    if (FT_Init_FreeType(&library) != 0 ||
        FT_New_Memory_Face(library, font_bytes.data(), static_cast<FT_Long>(font_bytes.size()), 0, &font) != 0) {
      throw std::bad_alloc();
    }
    return cairo_ft_font_face_create_for_ft_face(font, FT_LOAD_NO_HINTING);
  }();
  return face;
}

// A text is as wide at any size.
std::unique_ptr<cairo_font_options_t, decltype(&cairo_font_options_destroy)> unhinted() {
  cairo_font_options_t* const options = cairo_font_options_create();
  cairo_font_options_set_hint_metrics(options, CAIRO_HINT_METRICS_OFF);
  return {options, &cairo_font_options_destroy};
}

cairo_status_t append(void* to, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

void require_success(cairo_status_t status) {
  if (status == CAIRO_STATUS_NO_MEMORY) {
    throw std::bad_alloc();
  }
  if (status != CAIRO_STATUS_SUCCESS) {
    throw InternalError(fmt::format("a picture cannot be drawn: {}", cairo_status_to_string(status)));
  }
}

void set_colour(cairo_t* cairo, const Colour& colour) {
  cairo_set_source_rgb(cairo, colour.red, colour.green, colour.blue);
}

}  // namespace

Canvas::Canvas(int width, int height)
    : surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height)), cairo_(cairo_create(surface_)) {
  cairo_set_source_rgb(cairo_, 1, 1, 1);
  cairo_paint(cairo_);
  cairo_set_font_face(cairo_, font_face());
  const auto options = unhinted();
  cairo_set_font_options(cairo_, options.get());
  require_success(cairo_status(cairo_));
}

Canvas::~Canvas() {
  cairo_destroy(cairo_);
  cairo_surface_destroy(surface_);
}

double text_width(const std::string& text, double size) {
  cairo_matrix_t scale;
  cairo_matrix_t identity;
  cairo_matrix_init_scale(&scale, size, size);
  cairo_matrix_init_identity(&identity);
  const auto options = unhinted();
  const std::unique_ptr<cairo_scaled_font_t, decltype(&cairo_scaled_font_destroy)> font(
      cairo_scaled_font_create(font_face(), &scale, &identity, options.get()), &cairo_scaled_font_destroy);
  require_success(cairo_scaled_font_status(font.get()));
  cairo_text_extents_t extents;
  cairo_scaled_font_text_extents(font.get(), printable(text).c_str(), &extents);
  return extents.x_advance;
}

void Canvas::text(const std::string& text, double x, double y, double size, const Colour& colour, Align align) {
  const double width = align == Align::left ? 0 : text_width(text, size);
  cairo_set_font_size(cairo_, size);
  set_colour(cairo_, colour);
  cairo_new_path(cairo_);
  cairo_move_to(cairo_, align == Align::right ? x - width : x - width / 2, y);
  // As a path: letters would else stand on whole pixels, unevenly.
  cairo_text_path(cairo_, printable(text).c_str());
  cairo_fill(cairo_);
}

void Canvas::fitted_text(const std::string& text, double x, double y, double size, double width, const Colour& colour) {
  std::string shown = shortened(text, 400);
  size *= std::clamp(width / std::max(text_width(shown, size), 1.0), 0.75, 1.0);
  for (std::size_t most = 400; most > 3 && text_width(shown, size) > width; --most) {
    shown = shortened(text, most);
  }
  this->text(shown, x, y, size, colour);
}

void Canvas::line(double x0, double y0, double x1, double y1, double width, const Colour& colour) {
  set_colour(cairo_, colour);
  cairo_set_line_width(cairo_, width);
  cairo_move_to(cairo_, x0, y0);
  cairo_line_to(cairo_, x1, y1);
  cairo_stroke(cairo_);
}

void Canvas::circle(double x, double y, double radius, double width, const Colour& colour) {
  set_colour(cairo_, colour);
  cairo_set_line_width(cairo_, width);
  cairo_new_path(cairo_);
  cairo_arc(cairo_, x, y, radius, 0, 2 * std::numbers::pi);
  cairo_stroke(cairo_);
}

void Canvas::rectangle(double x0, double y0, double x1, double y1, const Colour& colour) {
  set_colour(cairo_, colour);
  cairo_rectangle(cairo_, x0, y0, x1 - x0, y1 - y0);
  cairo_fill(cairo_);
}

void Canvas::triangle(double x0, double y0, double x1, double y1, double x2, double y2, const Colour& colour) {
  set_colour(cairo_, colour);
  cairo_move_to(cairo_, x0, y0);
  cairo_line_to(cairo_, x1, y1);
  cairo_line_to(cairo_, x2, y2);
  cairo_fill(cairo_);
}

void Canvas::halved_image(const Image& image, int left, int top) {
  cairo_surface_flush(surface_);
  unsigned char* const pixels = cairo_image_surface_get_data(surface_);
  const int stride = cairo_image_surface_get_stride(surface_);
  const int right = std::min(image.width / 2, cairo_image_surface_get_width(surface_) - left);
  const int bottom = std::min(image.height / 2, cairo_image_surface_get_height(surface_) - top);
  for (int y = std::max(0, -top); y < bottom; ++y) {
    auto* const row = reinterpret_cast<std::uint32_t*>(pixels + std::ptrdiff_t{stride} * (top + y));
    const std::uint8_t* const upper = image.bytes.data() + 3 * std::ptrdiff_t{image.width} * 2 * y;
    const std::uint8_t* const lower = upper + 3 * std::ptrdiff_t{image.width};
    for (int x = std::max(0, -left); x < right; ++x) {
      std::uint32_t pixel = 0;
      for (int c = 0; c < 3; ++c) {
        const int at = 6 * x + c;
        pixel = pixel << 8 | std::uint32_t(upper[at] + upper[at + 3] + lower[at] + lower[at + 3] + 2) / 4;
      }
      row[left + x] = pixel;
    }
  }
  cairo_surface_mark_dirty(surface_);
}

std::string Canvas::png() const {
  require_success(cairo_status(cairo_));
  std::string bytes;
  require_success(cairo_surface_write_to_png_stream(surface_, append, &bytes));
  return bytes;
}

}  // namespace tunica
