#include "tunica/draw/chart.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/svg_text.hpp"
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

// Drawn at 380 pixels, the width of a phone, the ticks still have 9.
constexpr double chart_width = 640;
constexpr double plot_height = 400;
constexpr double tick_size = 15.5;
constexpr double label_size = 16;
constexpr double title_size = 18;
constexpr double mark_radius = 5.6;

// Okabe and Ito's palette without its yellow, which is too pale for a mark on white.
constexpr std::array<const char*, 7> palette{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                             "#E69F00", "#56B4E9", "#1A1A1A"};
constexpr int shapes = 8;

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

// -------------------------------------------------------------------------------------------------------------- marks

std::string colour(std::size_t series) { return palette[series % palette.size()]; }
int shape(std::size_t series) { return narrow<int>(series % shapes); }

std::string mark_shape(const Point& p, std::size_t series) {
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
      for (const ChartFailure& failure : series.failures) {
        if (failure.x) {
          xs.push_back(*failure.x);
        }
      }
    }
    if (chart.guide && chart.guide->y) {
      ys.push_back(*chart.guide->y);
    }
    title_ = wrapped(chart.title, chart_width - 40, title_size);
    x_ = make_axis(chart.x.scale, xs);
    y_ = make_axis(chart.y.scale, ys);
    double widest = 0;
    for (const Tick& tick : y_.ticks) {
      widest = std::max(widest, tick_width(tick));
    }
    plot_.left = 12 + label_size + 10 + widest + 10;
    plot_.right = chart_width - 26;
    plot_.top = 36 + title_line * real(title_.size());
    plot_.bottom = plot_.top + plot_height;
  }

  std::string svg() {
    const double bottom = draw_legend();
    std::string legend;
    std::swap(legend, out_);
    out_ = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
        "{1:.0f}\" "
        "font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif\">\n"
        "<title>{2}</title>\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        chart_width, std::ceil(bottom),
        safe(chart_.title.empty() ? chart_.y.label + " against " + chart_.x.label : chart_.title));
    for (std::size_t i = 0; i < title_.size(); ++i) {
      write(20, 30 + title_line * real(i), title_[i], title_size, "fill=\"#1a1a1a\" font-weight=\"bold\"");
    }
    draw_axes();
    draw_guide();
    draw_front();
    draw_marks();
    draw_failures();
    draw_labels();
    return out_ + legend + "</svg>\n";
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
      write_tick(x, plot_.bottom + 23, tick, "middle");
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
    write(chart_width / 2, plot_.bottom + 52, fitted(chart_.x.label, chart_width - 24, label_size), label_size,
          "fill=\"#1a1a1a\" text-anchor=\"middle\"");
    const double x = 12 + 0.7 * label_size;
    const double y = (plot_.top + plot_.bottom) / 2;
    write(x, y, fitted(chart_.y.label, plot_height + 60, label_size), label_size,
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

  void draw_guide() {
    if (!chart_.guide) {
      return;
    }
    const auto level = chart_.guide->y;
    const double low = std::max(x_.low, y_.low);
    const double high = std::min(x_.high, y_.high);
    const auto from = point({level ? x_.low : low, level.value_or(low), "", ""});
    const auto to = point({level ? x_.high : high, level.value_or(high), "", ""});
    if (from && to && (level || low < high)) {
      line(from->x, from->y, to->x, to->y, guide_style);
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

  void draw_failures() {
    if (has_failures()) {
      const double rim = rim_y();
      line(plot_.left, rim, plot_.right, rim, "stroke=\"#555555\" stroke-width=\"0.8\" stroke-dasharray=\"1 3\"");
    }
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      for (const ChartFailure& failure : chart_.series[s].failures) {
        const Point p = rim_point(failure);
        out_ += fmt::format("{} class=\"failure\" {}><title>{}</title></{}>\n", mark_shape(p, s), hollow(colour(s)),
                            safe(fmt::format("{}{}{}: {}", chart_.series[s].name,
                                             chart_.series[s].name.empty() ? "" : ", ", failure.name, failure.label)),
                            shape(s) == 0 ? "circle" : "polygon");
        taken_.push_back({p.x - mark_radius, p.y - mark_radius, p.x + mark_radius, p.y + mark_radius});
      }
    }
  }

  [[nodiscard]] bool has_failures() const {
    return std::ranges::any_of(chart_.series, [](const ChartSeries& series) { return !series.failures.empty(); });
  }

  [[nodiscard]] double rim_y() const { return chart_.y.more_is_better ? plot_.bottom : plot_.top; }

  [[nodiscard]] Point rim_point(const ChartFailure& failure) const {
    const auto x = failure.x ? x_.place(*failure.x) : std::nullopt;
    return {plot_.left + x.value_or(chart_.x.more_is_better ? 0 : 1) * (plot_.right - plot_.left), rim_y()};
  }

  static std::string hollow(const std::string& stroke) {
    return fmt::format("fill=\"#ffffff\" stroke=\"{}\" stroke-width=\"2\"", stroke);
  }

  void draw_labels() {
    for (const ChartSeries& series : chart_.series) {
      for (const ChartFailure& failure : series.failures) {
        draw_label(rim_point(failure), failure.label);
      }
      for (const ChartMark& mark : series.marks) {
        if (const auto p = point(mark)) {
          draw_label(*p, mark.label);
        }
      }
    }
  }

  // At the first of eight places beside the mark that is free; not at all where every one is taken.
  void draw_label(const Point& p, const std::string& label) {
    if (label.empty()) {
      return;
    }
    constexpr double size = 13;
    constexpr double near = mark_radius + 3;
    const std::string text = shortened(label, 28);
    const double width = text_width(text, size);
    const Rectangle region{plot_.left, plot_.top - 20, chart_width - 4, plot_.bottom};
    for (const Point& side : {Point{1, -1}, {1, 0}, {1, 1}, {0, -1}, {0, 1}, {-1, -1}, {-1, 0}, {-1, 1}}) {
      const double left = p.x + side.x * (side.y == 0 ? near + 2 : near - 2) + (side.x - 1) / 2 * width;
      const double middle = p.y + side.y * (side.x == 0 ? near + 6 : near + 1);
      const Rectangle box{left, middle - 0.5 * size, left + width, middle + 0.5 * size};
      if (region.holds(box) && std::ranges::none_of(taken_, [&](const Rectangle& r) { return r.meets(box); })) {
        write(left, middle + 0.36 * size, text, size, "fill=\"#444444\"");
        taken_.push_back(box);
        return;
      }
    }
  }

  struct LegendEntry {
    std::string line;  ///< style of a line, empty: none
    std::optional<std::size_t> series;
    std::string mark;  ///< how that of the series is filled
    std::string text;
  };

  [[nodiscard]] std::vector<LegendEntry> legend_entries() const {
    constexpr std::size_t most_names = 40;
    std::vector<LegendEntry> entries;
    std::vector<std::size_t> named;
    bool any = false;
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      any = any || !chart_.series[s].marks.empty();
      if (!chart_.series[s].name.empty()) {
        named.push_back(s);
      }
    }
    const std::size_t shown = named.size() > most_names ? most_names - 1 : named.size();
    for (std::size_t i = 0; i < shown; ++i) {
      const std::size_t s = named[i];
      entries.push_back(
          {chart_.series[s].joined ? fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"", colour(s)) : "", s,
           fmt::format("fill=\"{}\" stroke=\"#ffffff\" stroke-width=\"1\"", colour(s)), chart_.series[s].name});
    }
    if (shown < named.size()) {
      entries.push_back({"", {}, "", fmt::format("… and {} more", named.size() - shown)});
    }
    if (any && has_front()) {
      entries.push_back({front_style, {}, "", "Pareto front"});
    }
    if (chart_.guide) {
      entries.push_back({guide_style, {}, "", chart_.guide->label});
    }
    if (has_failures()) {
      entries.push_back({"", 0, hollow("#555555"), "hollow, on the rim: failed"});
    }
    return entries;
  }

  // The way in which a chart with a front gets better.
  [[nodiscard]] std::string better() const {
    return fmt::format("{} {} is better", chart_.y.more_is_better ? "Upper" : "Lower",
                       chart_.x.more_is_better ? "right" : "left");
  }

  // In as many columns as fit. @return the bottom of the picture
  double draw_legend() {
    constexpr double row = 24;
    double y = plot_.bottom + 84;
    std::string head = chart_.series_title;
    if (has_front()) {
      head += (head.empty() ? "" : ". ") + better();
    }
    if (!head.empty()) {
      write(20, y, fitted(head, chart_width - 40, tick_size), tick_size, "fill=\"#1a1a1a\" font-weight=\"bold\"");
      y += row;
    }
    std::vector<LegendEntry> entries = legend_entries();
    double widest = 1;
    for (LegendEntry& entry : entries) {
      entry.text = fitted(entry.text, chart_width - 70, tick_size);
      widest = std::max(widest, 42 + text_width(entry.text, tick_size) + 14);
    }
    const auto columns = std::max<std::size_t>(1, truncated<std::size_t>((chart_width - 30) / widest));
    const std::size_t rows = (entries.size() + columns - 1) / columns;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      const double left = 20 + widest * real(i / rows);
      const double middle = y + row * real(i % rows) - 0.36 * tick_size;
      if (!entries[i].line.empty()) {
        line(left, middle, left + 32, middle, entries[i].line);
      }
      if (entries[i].series) {
        out_ += mark_shape({left + 16, middle}, *entries[i].series) + " " + entries[i].mark + "/>\n";
      }
      write(left + 42, y + row * real(i % rows), entries[i].text, tick_size, "fill=\"#333333\"");
    }
    return y + row * real(rows) - 4;
  }

  static constexpr const char* front_style =
      "fill=\"none\" stroke=\"#8a8a8a\" stroke-width=\"1.4\" stroke-dasharray=\"6 4\"";
  static constexpr const char* guide_style = "fill=\"none\" stroke=\"#555555\" stroke-width=\"1.2\"";
  static constexpr double title_line = 24;

  const Chart& chart_;
  std::vector<std::vector<bool>> front_;
  Axis x_;
  Axis y_;
  Rectangle plot_;
  std::vector<std::string> title_;
  std::vector<Rectangle> taken_;
  std::string out_;
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
