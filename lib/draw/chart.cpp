#include "tunica/draw/chart.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/ticks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

namespace tunica {
namespace {

constexpr double chart_height = 600;
constexpr double plot_width = 720;
constexpr double tick_size = 13;
constexpr double label_size = 14.5;
constexpr double mark_radius = 5.2;

// Okabe and Ito's palette without its yellow, which is too pale for a mark on white.
constexpr std::array<const char*, 7> palette{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                             "#E69F00", "#56B4E9", "#1A1A1A"};
constexpr int shapes = 8;

// -------------------------------------------------------------------------------------------------------------- text

std::string escaped(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte == '&') {
      out += "&amp;";
    } else if (byte == '<') {
      out += "&lt;";
    } else if (byte == '>') {
      out += "&gt;";
    } else if (byte == '"') {
      out += "&quot;";
    } else if (byte < 0x20 || byte == 0x7f) {
      out += ' ';  // XML knows no control characters
    } else {
      out += text[i];
    }
  }
  return out;
}

// Replaces what is not UTF-8 (file names are any bytes), and U+FFFE, U+FFFF, which XML forbids.
std::string valid_utf8(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const std::size_t length = first < 0x80 ? 1 : first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
    bool good = length > 0 && first < 0xf5 && i + length <= text.size();
    unsigned code = length > 1 ? first & (0x7fu >> length) : first;
    for (std::size_t k = 1; good && k < length; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      good = (next & 0xc0) == 0x80;
      code = code << 6 | (next & 0x3fu);
    }
    constexpr std::array<unsigned, 5> least{0, 0, 0x80, 0x800, 0x10000};
    good = good && code >= least[length] && (code < 0xd800 || code > 0xdfff) && code != 0xfffe && code != 0xffff &&
           code <= 0x10ffff;
    out += good ? text.substr(i, length) : "?";
    i += good ? length : 1;
  }
  return out;
}

std::string safe(const std::string& text) { return escaped(valid_utf8(text)); }

// Width in pixels, from the widths of a sans-serif font; a little generous, the reader's font is unknown.
double text_width(const std::string& text, double size) {
  double units = 0;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xc0) == 0x80) {
      continue;
    }
    if (std::string_view("iljtfI.,:;|!'()[]/ -").find(c) != std::string_view::npos) {
      units += 0.34;
    } else if (std::string_view("mwMW%@").find(c) != std::string_view::npos) {
      units += 0.92;
    } else if (c >= 'A' && c <= 'Z') {
      units += 0.71;
    } else {
      units += 0.59;
    }
  }
  return units * size;
}

// Cuts the middle out of a text that is longer than `most` characters.
std::string shortened(const std::string& text, std::size_t most) {
  const std::string clean = valid_utf8(text);
  std::vector<std::string> characters;
  for (const char c : clean) {
    if ((static_cast<unsigned char>(c) & 0xc0) != 0x80) {
      characters.emplace_back();
    }
    characters.back() += c;
  }
  if (characters.size() <= most) {
    return clean;
  }
  std::string out;
  const std::size_t head = (most - 1) / 2;
  const std::size_t tail = most - 1 - head;
  for (std::size_t i = 0; i < head; ++i) {
    out += characters[i];
  }
  out += "…";
  for (std::size_t i = characters.size() - tail; i < characters.size(); ++i) {
    out += characters[i];
  }
  return out;
}

// -------------------------------------------------------------------------------------------------------------- axes

struct Tick {
  double value = 0;
  std::string text;      ///< empty: a small tick without text
  std::string exponent;  ///< after the text, raised
};

struct Axis {
  bool logarithmic = false;
  bool zeros = false;  ///< a lane for zeros at the low end of a logarithmic axis
  double low = 0;
  double high = 1;
  std::vector<Tick> ticks;

  static constexpr double lane = 0.07;

  /// 0 at the low end, 1 at the high end; none for a value that this axis cannot show.
  [[nodiscard]] std::optional<double> place(double value) const {
    if (!logarithmic) {
      // Halves: high - low may overflow.
      return (value / 2 - low / 2) / (high / 2 - low / 2);
    }
    const double start = zeros ? lane : 0;
    if (value > 0) {
      return start + (1 - start) * (std::log10(value) - std::log10(low)) / (std::log10(high) - std::log10(low));
    }
    return value == 0 && zeros ? std::optional(lane / 2) : std::nullopt;
  }
};

std::string exponent(int power) { return fmt::format("{}{}", power < 0 ? "−" : "", std::abs(power)); }

Tick power_tick(int factor, int power) {
  const double value = factor * std::pow(10, power);
  if (power >= -4 && power <= 4) {
    return {value, fmt::format("{:.{}f}", value, std::max(0, -power)), ""};
  }
  return {value, factor == 1 ? "10" : fmt::format("{}×10", factor), exponent(power)};
}

Axis logarithmic_axis(const std::vector<double>& values) {
  Axis axis;
  axis.logarithmic = true;
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (const double value : values) {
    axis.zeros = axis.zeros || value == 0;
    if (value > 0) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  if (most == 0) {
    least = most = 1;
  }
  // A margin of 4 % of the axis, at least a tenth of a decade.
  const double margin = std::max(0.1, 0.04 * (std::log10(most) - std::log10(least)));
  const double from = std::max(std::log10(least) - margin, -307.0);
  const double to = std::min(std::log10(most) + margin, 308.0);
  axis.low = std::pow(10, from);
  axis.high = std::pow(10, to);
  if (axis.zeros) {
    axis.ticks.push_back({0, "0", ""});
  }
  const int first = truncated<int>(std::floor(from));
  const int last = truncated<int>(std::ceil(to));
  const int every = std::max(1, (last - first + 7) / 8);
  const bool close = to - from < 2.6;
  for (int power = first; power <= last; ++power) {
    for (int factor = 1; factor < 10; ++factor) {
      const double value = factor * std::pow(10, power);
      if (!(value >= axis.low * (1 - 1e-9)) || !(value <= axis.high * (1 + 1e-9))) {
        continue;
      }
      const bool written = factor == 1 ? power % every == 0 : close && (factor == 2 || factor == 5);
      if (written) {
        axis.ticks.push_back(power_tick(factor, power));
      } else if (every == 1 || (factor == 1 && every <= 10)) {
        axis.ticks.push_back({value, "", ""});
      }
    }
  }
  return axis;
}

Axis linear_axis(const std::vector<double>& values) {
  Axis axis;
  constexpr int count = 7;
  double least = values.empty() ? 0 : *std::ranges::min_element(values);
  double most = values.empty() ? 1 : *std::ranges::max_element(values);
  if (least >= 0 && least < 0.4 * most) {
    least = 0;
  } else if (most <= 0 && most > 0.4 * least) {
    most = 0;
  }
  // Equal values, to rounding or next to zero, stand in the middle of a range of their size.
  const double narrowest = std::max(1e-12 * std::max(std::abs(least), std::abs(most)), 1e-290);
  if (!(most / 2 - least / 2 > narrowest)) {
    const double around = most == 0 ? 1 : std::max(0.1 * std::abs(most), 1e-290);
    least -= around;
    most += around;
  }
  axis.low = std::isfinite(least) ? least : -std::numeric_limits<double>::max();
  axis.high = std::isfinite(most) ? most : std::numeric_limits<double>::max();
  const double step = round_step(axis.low, axis.high, count);
  const double round_low = std::floor(axis.low / step + 1e-9) * step;
  const double round_high = std::ceil(axis.high / step - 1e-9) * step;
  if (step > 0 && std::isfinite(round_low) && std::isfinite(round_high)) {
    axis.low = round_low;
    axis.high = round_high;
  }
  const double size = std::max(std::abs(axis.low), std::abs(axis.high));
  const bool plain = size >= 1e-3 && size < 1e6;
  // All ticks with the power of the largest, with the decimals that the step needs.
  const int power = truncated<int>(std::floor(std::log10(size) + 1e-9));
  for (const double value : multiples(axis.low, axis.high, step)) {
    if (plain || value == 0) {
      axis.ticks.push_back({value, value == 0 ? "0" : tick_text(value, step), ""});
    } else {
      const double unit = std::pow(10, power);
      axis.ticks.push_back({value, tick_text(value / unit, step / unit) + "×10", exponent(power)});
    }
  }
  return axis;
}

Axis make_axis(Scale wanted, const std::vector<double>& values) {
  return resolved_scale(wanted, values) == Scale::logarithmic ? logarithmic_axis(values) : linear_axis(values);
}

double tick_width(const Tick& tick) {
  return text_width(tick.text, tick_size) + text_width(tick.exponent, 0.72 * tick_size);
}

// ------------------------------------------------------------------------------------------------------------- layout

struct Rectangle {
  double left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] bool meets(const Rectangle& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
  [[nodiscard]] bool holds(const Rectangle& other) const {
    return other.left >= left && other.right <= right && other.top >= top && other.bottom <= bottom;
  }
};

struct Point {
  double x = 0, y = 0;
};

class Drawing {
public:
  explicit Drawing(const Chart& chart) : chart_(chart), front_(pareto_front(chart)) {
    std::vector<double> xs;
    std::vector<double> ys;
    for (const auto& series : chart.series) {
      for (const auto& mark : series.marks) {
        TUNICA_ASSERT(std::isfinite(mark.x) && std::isfinite(mark.y));
        xs.push_back(mark.x);
        ys.push_back(mark.y);
      }
    }
    x_ = make_axis(chart.x.scale, xs);
    y_ = make_axis(chart.y.scale, ys);
    double widest = 0;
    for (const Tick& tick : y_.ticks) {
      widest = std::max(widest, tick_width(tick));
    }
    plot_.left = 24 + label_size + 12 + widest + 10;
    plot_.right = plot_.left + plot_width;
    plot_.top = chart.title.empty() ? 44 : 68;
    plot_.bottom = chart_height - 66;
  }

  std::string svg() {
    const std::string legend = draw_legend();
    const double width = std::ceil(legend_right_);
    out_ = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
        "{1:.0f}\" "
        "font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif\">\n"
        "<title>{2}</title>\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        width, chart_height, safe(chart_.title.empty() ? chart_.y.label + " against " + chart_.x.label : chart_.title));
    if (!chart_.title.empty()) {
      const double size = std::clamp(18 * (width - 48) / std::max(1.0, text_width(chart_.title, 18)), 11.0, 18.0);
      const auto fits = truncated<std::size_t>(std::max(10.0, (width - 48) / (0.55 * size)));
      write(24, 34, shortened(chart_.title, fits), size, "fill=\"#1a1a1a\" font-weight=\"bold\"");
    }
    draw_axes();
    draw_front();
    draw_marks();
    draw_labels();
    out_ += legend;
    return out_ + "</svg>\n";
  }

private:
  [[nodiscard]] std::optional<Point> point(const ChartMark& mark) const {
    const auto x = x_.place(mark.x);
    const auto y = y_.place(mark.y);
    if (!x || !y) {
      return {};
    }
    return Point{plot_.left + *x * (plot_.right - plot_.left), plot_.bottom - *y * (plot_.bottom - plot_.top)};
  }

  void write(double x, double y, const std::string& text, double size, const std::string& attributes) {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.1f}\" {}>{}</text>\n", x, y, size, attributes,
                        safe(text));
  }

  void write_tick(double x, double y, const Tick& tick, const char* anchor) {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"#333333\">{}", x, y,
                        tick_size, anchor, tick.text);
    if (!tick.exponent.empty()) {
      out_ += fmt::format("<tspan dy=\"-5\" font-size=\"{:.1f}\">{}</tspan>", 0.72 * tick_size, tick.exponent);
    }
    out_ += "</text>\n";
  }

  void line(double x0, double y0, double x1, double y1, const std::string& attributes) {
    out_ +=
        fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x0, y0, x1, y1, attributes);
  }

  void draw_axes() {
    const char* grid = "stroke=\"#e3e3e3\" stroke-width=\"1\"";
    const char* small = "stroke=\"#777777\" stroke-width=\"0.8\"";
    for (const Tick& tick : x_.ticks) {
      const double x = plot_.left + *x_.place(tick.value) * (plot_.right - plot_.left);
      if (tick.text.empty()) {
        line(x, plot_.bottom, x, plot_.bottom + 3.5, small);
        continue;
      }
      line(x, plot_.top, x, plot_.bottom, grid);
      line(x, plot_.bottom, x, plot_.bottom + 6, small);
      write_tick(x, plot_.bottom + 21, tick, "middle");
    }
    for (const Tick& tick : y_.ticks) {
      const double y = plot_.bottom - *y_.place(tick.value) * (plot_.bottom - plot_.top);
      if (tick.text.empty()) {
        line(plot_.left - 3.5, y, plot_.left, y, small);
        continue;
      }
      line(plot_.left, y, plot_.right, y, grid);
      line(plot_.left - 6, y, plot_.left, y, small);
      write_tick(plot_.left - 10, y + 0.36 * tick_size, tick, "end");
    }
    const char* frame = "stroke=\"#555555\" stroke-width=\"1.2\"";
    line(plot_.left, plot_.top, plot_.left, plot_.bottom, frame);
    line(plot_.left, plot_.bottom, plot_.right, plot_.bottom, frame);
    draw_breaks();
    write((plot_.left + plot_.right) / 2, plot_.bottom + 50, shortened(chart_.x.label, 90), label_size,
          "fill=\"#1a1a1a\" text-anchor=\"middle\"");
    const double x = 24 + 0.5 * label_size;
    const double y = (plot_.top + plot_.bottom) / 2;
    write(x, y, shortened(chart_.y.label, 64), label_size,
          fmt::format("fill=\"#1a1a1a\" text-anchor=\"middle\" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y));
  }

  // A gap in a logarithmic axis between its lane of zeros and its first value.
  void draw_breaks() {
    const char* blank = "stroke=\"#ffffff\" stroke-width=\"5\"";
    const char* stroke = "stroke=\"#555555\" stroke-width=\"1.2\"";
    if (x_.zeros) {
      const double x = plot_.left + Axis::lane * (plot_.right - plot_.left);
      line(x - 2.5, plot_.bottom, x + 2.5, plot_.bottom, blank);
      for (const double shift : {-3.0, 3.0}) {
        line(x + shift - 3, plot_.bottom + 6, x + shift + 3, plot_.bottom - 6, stroke);
      }
    }
    if (y_.zeros) {
      const double y = plot_.bottom - Axis::lane * (plot_.bottom - plot_.top);
      line(plot_.left, y - 2.5, plot_.left, y + 2.5, blank);
      for (const double shift : {-3.0, 3.0}) {
        line(plot_.left - 6, y + shift + 3, plot_.left + 6, y + shift - 3, stroke);
      }
    }
  }

  [[nodiscard]] bool has_front() const { return chart_.x.is_ranked && chart_.y.is_ranked; }

  void draw_front() {
    std::vector<Point> corners;
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      for (std::size_t m = 0; m < chart_.series[s].marks.size(); ++m) {
        if (const auto p = point(chart_.series[s].marks[m]); p && front_[s][m]) {
          corners.push_back(*p);
        }
      }
    }
    if (corners.empty()) {
      return;
    }
    // From the best x to the best y, each step first along x: what lies behind the stairs is dominated.
    const bool to_left = chart_.x.more_is_better;
    const bool upward_better = chart_.y.more_is_better;
    std::ranges::sort(corners, [&](const Point& a, const Point& b) {
      return a.x != b.x ? (to_left ? a.x > b.x : a.x < b.x) : (upward_better ? a.y < b.y : a.y > b.y);
    });
    std::string path = fmt::format("M{:.1f} {:.1f}", corners.front().x, upward_better ? plot_.bottom : plot_.top);
    path += fmt::format("V{:.1f}", corners.front().y);
    for (std::size_t i = 1; i < corners.size(); ++i) {
      path += fmt::format("H{:.1f}V{:.1f}", corners[i].x, corners[i].y);
    }
    path += fmt::format("H{:.1f}", to_left ? plot_.left : plot_.right);
    out_ += fmt::format("<path class=\"front\" d=\"{}\" {}/>\n", path, front_style);
  }

  static std::string colour(std::size_t series) { return palette[series % palette.size()]; }
  static int shape(std::size_t series) { return narrow<int>(series % shapes); }

  static std::string mark_shape(const Point& p, std::size_t series) {
    const double r = mark_radius;
    const auto polygon = [&](const std::vector<Point>& corners) {
      std::string text = "<polygon points=\"";
      for (const Point& c : corners) {
        text += fmt::format("{:.2f},{:.2f} ", p.x + r * c.x, p.y + r * c.y);
      }
      text.back() = '"';
      return text;
    };
    switch (shape(series)) {
      case 0:
        return fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"{}\"", p.x, p.y, r);
      case 1:
        return polygon({{-0.9, -0.9}, {0.9, -0.9}, {0.9, 0.9}, {-0.9, 0.9}});
      case 2:
        return polygon({{0, -1.2}, {1.1, 0.85}, {-1.1, 0.85}});
      case 3:
        return polygon({{0, -1.25}, {1.25, 0}, {0, 1.25}, {-1.25, 0}});
      case 4:
        return polygon({{0, 1.2}, {1.1, -0.85}, {-1.1, -0.85}});
      case 5:  // plus
        return polygon({{-.4, -1.2},
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
        return polygon({{0, -.55},
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
        return polygon({{1.1, 0}, {.55, .95}, {-.55, .95}, {-1.1, 0}, {-.55, -.95}, {.55, -.95}});
    }
  }

  void draw_marks() {
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      const ChartSeries& series = chart_.series[s];
      if (series.joined) {
        std::string path;
        for (const ChartMark& mark : series.marks) {
          if (const auto p = point(mark)) {
            path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", p->x, p->y);
          }
        }
        out_ +=
            fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\" stroke-linejoin=\"round\"/>\n",
                        path, colour(s));
      }
    }
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      for (const ChartMark& mark : chart_.series[s].marks) {
        if (const auto p = point(mark)) {
          out_ += fmt::format(
              "{} class=\"mark\" fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1\"><title>{}</title></{}>\n",
              mark_shape(*p, s), colour(s),
              safe(fmt::format("{}{}{}: {}, {}", chart_.series[s].name, chart_.series[s].name.empty() ? "" : ", ",
                               mark.name, short_number(mark.x), short_number(mark.y))),
              shape(s) == 0 ? "circle" : "polygon");
          taken_.push_back({p->x - mark_radius, p->y - mark_radius, p->x + mark_radius, p->y + mark_radius});
        }
      }
    }
  }

  // Each label at the first of eight places beside its mark that is free; none where all are taken.
  void draw_labels() {
    constexpr double size = 11.5;
    for (const ChartSeries& series : chart_.series) {
      for (const ChartMark& mark : series.marks) {
        const auto p = point(mark);
        if (!p || mark.label.empty()) {
          continue;
        }
        const std::string text = shortened(mark.label, 28);
        const double width = text_width(text, size);
        constexpr double near = mark_radius + 3;
        for (const Point& side : {Point{1, -1}, {1, 0}, {1, 1}, {0, -1}, {0, 1}, {-1, -1}, {-1, 0}, {-1, 1}}) {
          const double left = p->x + side.x * (side.y == 0 ? near + 2 : near - 2) + (side.x - 1) / 2 * width;
          const double middle = p->y + side.y * (side.x == 0 ? near + 6 : near + 1);
          const Rectangle box{left, middle - 0.5 * size, left + width, middle + 0.5 * size};
          const bool free =
              plot_.holds(box) && std::ranges::none_of(taken_, [&](const Rectangle& r) { return r.meets(box); });
          if (free) {
            write(left, middle + 0.36 * size, text, size, "fill=\"#444444\"");
            taken_.push_back(box);
            break;
          }
        }
      }
    }
  }

  // @return the elements; sets legend_right_, which decides the width of the picture.
  std::string draw_legend() {
    std::vector<std::size_t> named;
    bool any = false;
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      any = any || !chart_.series[s].marks.empty();
      if (!chart_.series[s].name.empty()) {
        named.push_back(s);
      }
    }
    legend_right_ = plot_.right + 30;
    if (!any) {
      return {};
    }
    std::swap(out_, held_);
    if (!named.empty()) {
      draw_legend_column(named);
    } else if (has_front()) {
      line(plot_.right - 130, plot_.top - 14, plot_.right - 96, plot_.top - 14, front_style);
      write(plot_.right - 88, plot_.top - 9.5, "Pareto front", tick_size, "fill=\"#333333\"");
    }
    std::swap(out_, held_);
    return held_;
  }

  void draw_legend_column(const std::vector<std::size_t>& named) {
    constexpr double row = 21;
    constexpr std::size_t most_rows = 20;
    constexpr std::size_t most_names = 2 * most_rows;
    const double top = plot_.top + 6;
    double left = plot_.right + 34;
    double widest = 0;
    double y = top;
    const auto entry = [&](const std::string& text, double indent) {
      const std::string name = shortened(text, 34);
      write(left + indent, y + 0.36 * tick_size, name, tick_size, "fill=\"#333333\"");
      widest = std::max(widest, indent + text_width(name, tick_size));
    };
    if (!chart_.series_title.empty()) {
      const std::string title = shortened(chart_.series_title, 40);
      write(left - 6, y + 0.36 * tick_size, title, tick_size, "fill=\"#1a1a1a\" font-weight=\"bold\"");
      widest = text_width(title, 1.08 * tick_size);
      y += row;
    }
    if (has_front()) {
      line(left - 8, y, left + 22, y, front_style);
      entry("Pareto front", 30);
      y += row;
    }
    const double first = y;
    const std::size_t shown = named.size() > most_names ? most_names - 1 : named.size();
    for (std::size_t i = 0; i < shown; ++i) {
      if (i == most_rows) {
        left += widest + 28;
        widest = 0;
        y = first;
      }
      const std::size_t s = named[i];
      if (chart_.series[s].joined) {
        line(left - 8, y, left + 22, y, fmt::format("stroke=\"{}\" stroke-width=\"1.8\"", colour(s)));
      }
      out_ += fmt::format("{} fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1\"/>\n", mark_shape({left + 7, y}, s),
                          colour(s));
      entry(chart_.series[s].name, 30);
      y += row;
    }
    if (shown < named.size()) {
      entry(fmt::format("… and {} more", named.size() - shown), 30);
    }
    legend_right_ = left + widest + 24;
  }

  static constexpr const char* front_style =
      "fill=\"none\" stroke=\"#8a8a8a\" stroke-width=\"1.4\" stroke-dasharray=\"6 4\"";

  const Chart& chart_;
  std::vector<std::vector<bool>> front_;
  Axis x_;
  Axis y_;
  Rectangle plot_;
  double legend_right_ = 0;
  std::vector<Rectangle> taken_;
  std::string out_;
  std::string held_;
};

}  // namespace

Scale resolved_scale(Scale wanted, const std::vector<double>& values) {
  if (wanted != Scale::automatic) {
    return wanted;
  }
  double least = std::numeric_limits<double>::infinity();
  double most = 0;
  for (const double value : values) {
    if (value < 0) {
      return Scale::linear;
    }
    if (value > 0) {
      least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  return most / 10 > least ? Scale::logarithmic : Scale::linear;
}

std::vector<std::vector<bool>> pareto_front(const Chart& chart) {
  struct Entry {
    double x, y;
    std::size_t series, mark;
  };
  std::vector<Entry> entries;
  std::vector<std::vector<bool>> front;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    front.emplace_back(chart.series[s].marks.size(), false);
    for (std::size_t m = 0; m < chart.series[s].marks.size(); ++m) {
      const ChartMark& mark = chart.series[s].marks[m];
      entries.push_back({chart.x.more_is_better ? -mark.x : mark.x, chart.y.more_is_better ? -mark.y : mark.y, s, m});
    }
  }
  if (!chart.x.is_ranked || !chart.y.is_ranked) {
    return front;
  }
  std::ranges::sort(entries, [](const Entry& a, const Entry& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  double best = std::numeric_limits<double>::infinity();
  double best_x = 0;
  for (const Entry& entry : entries) {
    // Two runs with the same pair of values are both on the front.
    if (entry.y < best || (entry.y == best && entry.x == best_x)) {
      front[entry.series][entry.mark] = true;
      best = entry.y;
      best_x = entry.x;
    }
  }
  return front;
}

std::string chart_svg(const Chart& chart) { return Drawing(chart).svg(); }

}  // namespace tunica
