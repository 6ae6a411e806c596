#pragma once

#include <cstdint>
#include <string>
#include <vector>

struct _cairo;
struct _cairo_surface;

/// Texts and lines over images, smooth, as a PNG. Lengths in pixels, y downward.
namespace tunica {

struct Colour {
  double red = 0, green = 0, blue = 0;  ///< 0 … 1
};

/// Red, green, blue, a byte each, in rows from the top.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> bytes;
};

enum class Align { left, centre, right };

/// White at first. Texts are UTF-8 of any bytes, in Noto Sans; a character that it lacks is drawn as an empty box.
/// Errors: std::bad_alloc.
class Canvas {
public:
  Canvas(int width, int height);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  /// (x, y) is on the base line, at the left, in the middle or at the right end.
  void text(const std::string& text, double x, double y, double size, const Colour& colour, Align align = Align::left);

  /// Smaller by a quarter at most, then without its middle, so that it fits into `width`.
  void fitted_text(const std::string& text, double x, double y, double size, double width, const Colour& colour);

  void line(double x0, double y0, double x1, double y1, double width, const Colour& colour);
  void circle(double x, double y, double radius, double width, const Colour& colour);
  void rectangle(double x0, double y0, double x1, double y1, const Colour& colour);
  void triangle(double x0, double y0, double x1, double y1, double x2, double y2, const Colour& colour);

  /// Puts an image there, each 2 x 2 of its pixels as one: smooth edges. What reaches beyond the canvas is cut.
  void halved_image(const Image& image, int x, int y);

  [[nodiscard]] std::string png() const;

private:
  _cairo_surface* surface_;
  _cairo* cairo_;
};

}  // namespace tunica
