#pragma once

#include <cstddef>
#include <string>

/// Colours and marks of charts. Each colour has a light and a dark form; the reader's system chooses.
namespace tunica {

// Drawn at 380 pixels, the width of a phone, the ticks still have 9.
inline constexpr double chart_width = 640;
inline constexpr double tick_size = 15.5;
inline constexpr double bold_width = 1.08;  // against plain letters, in Noto Sans

/// Pixels.
struct ChartPoint {
  double x = 0, y = 0;
};

inline constexpr double mark_radius = 5.6;
inline constexpr std::size_t mark_shapes = 8;

enum class Ink { paper, text, soft_text, grid, small_tick, frame, front, guide, first_series };

/// That of a series; seven that the colour-blind tell apart, then from the beginning.
Ink series_ink(std::size_t series);

/// Attributes of an SVG element. Readers that know no CSS variables see the light colours.
std::string fill(Ink ink);
std::string stroke(Ink ink, double width, const std::string& more = {});
std::string fill_and_stroke(Ink inside, Ink line, double width);

/// The style element that makes the colours light or dark, for a picture whose outermost element has `sheet_class`.
std::string style_sheet();
inline constexpr const char* sheet_class = "tunica-chart";

/// Lines of the parts that stand in the picture and in its legend; attributes, too.
std::string series_line(std::size_t series);
std::string front_line();
std::string guide_line();
std::string full_mark(std::size_t series);
std::string hollow_mark(Ink line);

/// Whole elements.
std::string text_element(double x, double y, const std::string& text, double size, const std::string& attributes);
std::string line_element(double x0, double y0, double x1, double y1, const std::string& attributes);

/// The beginning of an element with the mark of a series around `p`, without the end of the tag, and the element's
/// name.
std::string mark_shape(const ChartPoint& p, std::size_t series);
const char* mark_element(std::size_t series);

}  // namespace tunica
