#include "tunica/draw/detail/chart_style.hpp"

#include "tunica/draw/detail/svg_text.hpp"

#include <fmt/format.h>

#include <array>
#include <vector>

namespace tunica {
namespace {

struct Shade {
  const char* name;
  const char* light;
  const char* dark;
};

// In the order of Ink. The series: Okabe and Ito's palette without its yellow, which is too pale for a mark on white;
// in the dark the same hues, lighter.
constexpr std::size_t series_inks = 7;
constexpr std::array<Shade, 8 + series_inks> shades{
    Shade{"paper", "#ffffff", "#17191c"}, {"text", "#1a1a1a", "#eeeeee"},       {"soft-text", "#333333", "#cfd2d6"},
    {"grid", "#e3e3e3", "#34383d"},       {"small-tick", "#777777", "#92979d"}, {"frame", "#555555", "#b4b9bf"},
    {"front", "#767676", "#9aa0a6"},      {"guide", "#555555", "#b4b9bf"},      {"series-1", "#0072B2", "#3f9fe0"},
    {"series-2", "#D55E00", "#f58a3c"},   {"series-3", "#009E73", "#2fc79a"},   {"series-4", "#CC79A7", "#e295c0"},
    {"series-5", "#E69F00", "#f0b63a"},   {"series-6", "#56B4E9", "#8fd3fb"},   {"series-7", "#1A1A1A", "#e8e8e8"}};

const Shade& shade(Ink ink) { return shades.at(static_cast<std::size_t>(ink)); }

std::string variable(const char* property, Ink ink) {
  return fmt::format("{}:var(--{},{})", property, shade(ink).name, shade(ink).light);
}

std::string polygon(const ChartPoint& p, const std::vector<ChartPoint>& corners) {
  std::string text = "<polygon points=\"";
  for (const ChartPoint& c : corners) {
    text += fmt::format("{:.2f},{:.2f} ", p.x + mark_radius * c.x, p.y + mark_radius * c.y);
  }
  text.back() = '"';
  return text;
}

}  // namespace

Ink series_ink(std::size_t series) {
  return static_cast<Ink>(static_cast<std::size_t>(Ink::first_series) + series % series_inks);
}

std::string fill(Ink ink) { return fmt::format("fill=\"{}\" style=\"{}\"", shade(ink).light, variable("fill", ink)); }

std::string stroke(Ink ink, double width, const std::string& more) {
  return fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"{}\"{}{} style=\"{}\"", shade(ink).light, width,
                     more.empty() ? "" : " ", more, variable("stroke", ink));
}

std::string fill_and_stroke(Ink inside, Ink line, double width) {
  return fmt::format("fill=\"{}\" stroke=\"{}\" stroke-width=\"{}\" style=\"{};{}\"", shade(inside).light,
                     shade(line).light, width, variable("fill", inside), variable("stroke", line));
}

std::string style_sheet() {
  std::string light;
  std::string dark;
  for (const Shade& shade : shades) {
    light += fmt::format("--{}:{};", shade.name, shade.light);
    dark += fmt::format("--{}:{};", shade.name, shade.dark);
  }
  return fmt::format("<style>.{0}{{{1}}}@media (prefers-color-scheme:dark){{.{0}{{{2}}}}}</style>\n", sheet_class,
                     light, dark);
}

std::string series_line(std::size_t series) { return stroke(series_ink(series), 1.8, "stroke-linejoin=\"round\""); }
std::string front_line() { return stroke(Ink::front, 1.4, "stroke-dasharray=\"6 4\""); }
std::string guide_line() { return stroke(Ink::guide, 1.2); }
std::string full_mark(std::size_t series) { return fill_and_stroke(series_ink(series), Ink::paper, 1); }
std::string hollow_mark(Ink line) { return fill_and_stroke(Ink::paper, line, 2); }

std::string text_element(double x, double y, const std::string& text, double size, const std::string& attributes) {
  // The reader's font may be wider than the one that is measured.
  const double width = text_width(text, size) * (attributes.find("bold") != std::string::npos ? bold_width : 1);
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.1f}\" textLength=\"{:.1f}\" "
      "lengthAdjust=\"spacingAndGlyphs\" {}>{}</text>\n",
      x, y, size, width, attributes, safe(text));
}

std::string line_element(double x0, double y0, double x1, double y1, const std::string& attributes) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x0, y0, x1, y1,
                     attributes);
}

const char* mark_element(std::size_t series) { return series % mark_shapes == 0 ? "circle" : "polygon"; }

std::string mark_shape(const ChartPoint& p, std::size_t series) {
  switch (series % mark_shapes) {
    case 0:
      return fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{}\"", p.x, p.y, mark_radius);
    case 1:
      return polygon(p, {{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}});
    case 2:
      return polygon(p, {{0, -1.2}, {1.1, 0.85}, {-1.1, 0.85}});
    case 3:
      return polygon(p, {{0, -1.25}, {1.25, 0}, {0, 1.25}, {-1.25, 0}});
    case 4:
      return polygon(p, {{0, 1.2}, {1.1, -0.85}, {-1.1, -0.85}});
    case 5:  // plus
      return polygon(p, {{-.4, -1.2},
                         {.4, -1.2},
                         {.4, -.4},
                         {1.2, -.4},
                         {1.2, .4},
                         {.4, .4},
                         {.4, 1.2},
                         {-.4, 1.2},
                         {-.4, .4},
                         {-1.2, .4},
                         {-1.2, -.4},
                         {-.4, -.4}});
    case 6:  // cross
      return polygon(p, {{0, -.55},
                         {.6, -1.15},
                         {1.15, -.6},
                         {.55, 0},
                         {1.15, .6},
                         {.6, 1.15},
                         {0, .55},
                         {-.6, 1.15},
                         {-1.15, .6},
                         {-.55, 0},
                         {-1.15, -.6},
                         {-.6, -1.15}});
    default:  // hexagon
      return polygon(p, {{1.1, 0}, {.55, .95}, {-.55, .95}, {-1.1, 0}, {-.55, -.95}, {.55, -.95}});
  }
}

}  // namespace tunica
