#include "tunica/draw/chart.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/detail/chart_axis.hpp"
#include "tunica/draw/detail/chart_legend.hpp"
#include "tunica/draw/detail/chart_style.hpp"
#include "tunica/draw/detail/svg_text.hpp"
#include "tunica/draw/detail/ticks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace tunica {
namespace {

constexpr double plot_height = 400;
constexpr double label_size = 16;
constexpr double title_size = 18;

double tick_width(const Tick& tick) {
  return text_width(tick.text, tick_size) + text_width(tick.exponent, 0.72 * tick_size);
}

struct Rectangle {
  double left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] bool meets(const Rectangle& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
  [[nodiscard]] bool holds(const Rectangle& other) const {
    return other.left >= left && other.right <= right && other.top >= top && other.bottom <= bottom;
  }
};

void require_finite(double value, const std::string& of) {
  if (!std::isfinite(value)) {
    throw InputError(fmt::format("{}: a value of the chart is not finite", of));
  }
}

class ChartDrawing {
public:
  /// pareto_front() checks the marks.
  explicit ChartDrawing(const Chart& chart) : chart_(chart), front_(pareto_front(chart)) {
    std::vector<double> xs;
    std::vector<double> ys;
    for (const auto& series : chart.series) {
      for (const auto& mark : series.marks) {
        xs.push_back(mark.x);
        ys.push_back(mark.y);
      }
      for (const ChartFailure& failure : series.failures) {
        if (failure.x) {
          require_finite(*failure.x, failure.name);
          xs.push_back(*failure.x);
        }
      }
    }
    if (chart.guide && chart.guide->y) {
      require_finite(*chart.guide->y, chart.guide->label);
      ys.push_back(*chart.guide->y);
    }
    title_ = wrapped(chart.title, (chart_width - 40) / bold_width, title_size);
    x_ = make_axis(chart.x.scale, xs);
    y_ = make_axis(chart.y.scale, ys);
    double widest = 0;
    for (const Tick& tick : y_.ticks) {
      widest = std::max(widest, tick_width(tick));
    }
    x_label_ = wrapped(chart.x.label, chart_width - 24, label_size);
    y_label_ = wrapped(chart.y.label, plot_height + 60, label_size);
    plot_.left = 12 + label_line * real(std::max<std::size_t>(y_label_.size(), 1)) + 8 + widest + 10;
    plot_.right = chart_width - 26;
    plot_.top = 36 + title_line * real(title_.size());
    plot_.bottom = plot_.top + plot_height;
  }

  std::string svg() {
    const Legend legend = chart_legend(chart_, plot_.bottom + label_room());
    out_ = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<svg class=\"{3}\" xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 "
        "{0:.0f} "
        "{1:.0f}\" "
        "font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif\">\n"
        "<title>{2}</title>\n"
        "{4}<rect width=\"100%\" height=\"100%\" {5}/>\n",
        chart_width, std::ceil(legend.bottom),
        safe(chart_.title.empty() ? chart_.y.label + " against " + chart_.x.label : chart_.title), sheet_class,
        style_sheet(), fill(Ink::paper));
    for (std::size_t i = 0; i < title_.size(); ++i) {
      write(20, 30 + title_line * real(i), title_[i], title_size, fill(Ink::text) + " font-weight=\"bold\"");
    }
    draw_axes();
    draw_guide();
    draw_front();
    draw_marks();
    draw_failures();
    draw_labels();
    return out_ + legend.svg + "</svg>\n";
  }

private:
  // Below the axis: its ticks, its label, and the way to the legend.
  [[nodiscard]] double label_room() const {
    return 84 + label_line * real(std::max<std::size_t>(x_label_.size(), 1) - 1);
  }

  [[nodiscard]] std::optional<ChartPoint> point(const ChartMark& mark) const {
    const auto x = x_.place(mark.x);
    const auto y = y_.place(mark.y);
    if (!x || !y) {
      return {};
    }
    return ChartPoint{plot_.left + *x * (plot_.right - plot_.left), plot_.bottom - *y * (plot_.bottom - plot_.top)};
  }

  void write(double x, double y, const std::string& text, double size, const std::string& attributes) {
    out_ += text_element(x, y, text, size, attributes);
  }

  void write_tick(double x, double y, const Tick& tick, const char* anchor) {
    out_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" {}>{}", x, y, tick_size,
                        anchor, fill(Ink::soft_text), tick.text);
    if (!tick.exponent.empty()) {
      out_ += fmt::format("<tspan dy=\"-5\" font-size=\"{:.1f}\">{}</tspan>", 0.72 * tick_size, tick.exponent);
    }
    out_ += "</text>\n";
  }

  void line(double x0, double y0, double x1, double y1, const std::string& attributes) {
    out_ += line_element(x0, y0, x1, y1, attributes);
  }

  void draw_axes() {
    const std::string grid = stroke(Ink::grid, 1);
    const std::string small = stroke(Ink::small_tick, 0.8);
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
    const std::string frame = stroke(Ink::frame, 1.2);
    line(plot_.left, plot_.top, plot_.left, plot_.bottom, frame);
    line(plot_.left, plot_.bottom, plot_.right, plot_.bottom, frame);
    draw_breaks();
    const std::string middle = fill(Ink::text) + " text-anchor=\"middle\"";
    for (std::size_t i = 0; i < x_label_.size(); ++i) {
      write(chart_width / 2, plot_.bottom + 52 + label_line * real(i), x_label_[i], label_size, middle);
    }
    const double y = (plot_.top + plot_.bottom) / 2;
    for (std::size_t i = 0; i < y_label_.size(); ++i) {
      const double x = 12 + 0.7 * label_size + label_line * real(i);
      write(x, y, y_label_[i], label_size, fmt::format("{} transform=\"rotate(-90 {:.1f} {:.1f})\"", middle, x, y));
    }
  }

  // A gap in a logarithmic axis between its lane of zeros and its first value.
  void draw_breaks() {
    const std::string blank = stroke(Ink::paper, 5);
    const std::string pen = stroke(Ink::frame, 1.2);
    if (x_.zeros) {
      const double x = plot_.left + DrawnAxis::lane * (plot_.right - plot_.left);
      line(x - 2.5, plot_.bottom, x + 2.5, plot_.bottom, blank);
      for (const double shift : {-3.0, 3.0}) {
        line(x + shift - 3, plot_.bottom + 6, x + shift + 3, plot_.bottom - 6, pen);
      }
    }
    if (y_.zeros) {
      const double y = plot_.bottom - DrawnAxis::lane * (plot_.bottom - plot_.top);
      line(plot_.left, y - 2.5, plot_.left, y + 2.5, blank);
      for (const double shift : {-3.0, 3.0}) {
        line(plot_.left - 6, y + shift + 3, plot_.left + 6, y + shift - 3, pen);
      }
    }
  }

  void draw_front() {
    std::vector<ChartPoint> corners;
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
    std::ranges::sort(corners, [&](const ChartPoint& a, const ChartPoint& b) {
      return a.x != b.x ? (to_left ? a.x > b.x : a.x < b.x) : (upward_better ? a.y < b.y : a.y > b.y);
    });
    std::string path = fmt::format("M{:.1f} {:.1f}", corners.front().x, upward_better ? plot_.bottom : plot_.top);
    path += fmt::format("V{:.1f}", corners.front().y);
    for (std::size_t i = 1; i < corners.size(); ++i) {
      path += fmt::format("H{:.1f}V{:.1f}", corners[i].x, corners[i].y);
    }
    path += fmt::format("H{:.1f}", to_left ? plot_.left : plot_.right);
    out_ += fmt::format("<path class=\"front\" d=\"{}\" {}/>\n", path, front_line());
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
      line(from->x, from->y, to->x, to->y, guide_line());
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
        out_ += fmt::format("<path d=\"{}\" {}/>\n", path, series_line(s));
      }
    }
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      for (const ChartMark& mark : chart_.series[s].marks) {
        if (const auto p = point(mark)) {
          out_ += fmt::format(
              "{} class=\"mark\" {}><title>{}</title></{}>\n", mark_shape(*p, s), full_mark(s),
              safe(fmt::format("{}{}{}: {}, {}", chart_.series[s].name, chart_.series[s].name.empty() ? "" : ", ",
                               mark.name, short_number(mark.x), short_number(mark.y))),
              mark_element(s));
          taken_.push_back({p->x - mark_radius, p->y - mark_radius, p->x + mark_radius, p->y + mark_radius});
        }
      }
    }
  }

  void draw_failures() {
    if (has_failures(chart_)) {
      const double rim = rim_y();
      line(plot_.left, rim, plot_.right, rim, stroke(Ink::frame, 0.8, "stroke-dasharray=\"1 3\""));
    }
    for (std::size_t s = 0; s < chart_.series.size(); ++s) {
      for (const ChartFailure& failure : chart_.series[s].failures) {
        const ChartPoint p = rim_point(failure);
        out_ += fmt::format("{} class=\"failure\" {}><title>{}</title></{}>\n", mark_shape(p, s),
                            hollow_mark(series_ink(s)),
                            safe(fmt::format("{}{}{}: {}", chart_.series[s].name,
                                             chart_.series[s].name.empty() ? "" : ", ", failure.name, failure.label)),
                            mark_element(s));
        taken_.push_back({p.x - mark_radius, p.y - mark_radius, p.x + mark_radius, p.y + mark_radius});
      }
    }
  }

  [[nodiscard]] double rim_y() const { return chart_.y.more_is_better ? plot_.bottom : plot_.top; }

  [[nodiscard]] ChartPoint rim_point(const ChartFailure& failure) const {
    const auto x = failure.x ? x_.place(*failure.x) : std::nullopt;
    return {plot_.left + x.value_or(chart_.x.more_is_better ? 0 : 1) * (plot_.right - plot_.left), rim_y()};
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
  void draw_label(const ChartPoint& p, const std::string& label) {
    if (label.empty()) {
      return;
    }
    constexpr double size = 13;
    constexpr double near = mark_radius + 3;
    const std::string text = shortened(label, 28);
    const double width = text_width(text, size);
    const Rectangle region{plot_.left, plot_.top - 20, chart_width - 4, plot_.bottom};
    for (const ChartPoint& side : {ChartPoint{1, -1}, {1, 0}, {1, 1}, {0, -1}, {0, 1}, {-1, -1}, {-1, 0}, {-1, 1}}) {
      const double left = p.x + side.x * (side.y == 0 ? near + 2 : near - 2) + (side.x - 1) / 2 * width;
      const double middle = p.y + side.y * (side.x == 0 ? near + 6 : near + 1);
      const Rectangle box{left, middle - 0.5 * size, left + width, middle + 0.5 * size};
      if (region.holds(box) && std::ranges::none_of(taken_, [&](const Rectangle& r) { return r.meets(box); })) {
        write(left, middle + 0.36 * size, text, size, fill(Ink::soft_text));
        taken_.push_back(box);
        return;
      }
    }
  }

  static constexpr double title_line = 24;
  static constexpr double label_line = 20;

  const Chart& chart_;
  std::vector<std::vector<bool>> front_;
  DrawnAxis x_;
  DrawnAxis y_;
  Rectangle plot_;
  std::vector<std::string> title_;
  std::vector<std::string> x_label_;
  std::vector<std::string> y_label_;
  std::vector<Rectangle> taken_;
  std::string out_;
};

}  // namespace

std::string chart_svg(const Chart& chart) { return ChartDrawing(chart).svg(); }

}  // namespace tunica
