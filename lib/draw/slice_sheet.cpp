#include "tunica/draw/slice_sheet.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/draw/detail/png.hpp"

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>

namespace tunica {
namespace {

constexpr int panel_gap = 4;       // pixels between panels
constexpr int sub_pixel_bits = 4;  // of cv::line: sixteenths of a pixel

// The colour of a sample, red, green, blue: what is selected keeps its grey, tinted.
cv::Vec3b sample_colour(unsigned char grey, bool selected) {
  const double level = grey;
  return selected ? cv::Vec3b(cv::saturate_cast<unsigned char>(46 + 0.30 * level),
                              cv::saturate_cast<unsigned char>(92 + 0.36 * level),
                              cv::saturate_cast<unsigned char>(140 + 0.40 * level))
                  : cv::Vec3b::all(cv::saturate_cast<unsigned char>(16 + 0.62 * level));
}

// @param scale  pixels per mm
void draw_panel(cv::Mat target, const SlicePanel& panel, double scale) {
  const Vec2 step = scale * panel.spacing;
  const Vec2 corner(0.5 * (target.cols - step.x() * panel.columns), 0.5 * (target.rows - step.y() * panel.rows));
  for (int y = 0; y < target.rows; ++y) {
    for (int x = 0; x < target.cols; ++x) {
      const int column = cvFloor((x + 0.5 - corner.x()) / step.x());
      const int row = cvFloor((y + 0.5 - corner.y()) / step.y());
      if (column >= 0 && row >= 0 && column < panel.columns && row < panel.rows) {
        const auto at = narrow<std::size_t>(row) * narrow<std::size_t>(panel.columns) + narrow<std::size_t>(column);
        target.at<cv::Vec3b>(y, x) = sample_colour(panel.grey[at], panel.selected[at] != 0);
      }
    }
  }
  const auto place = [&](const Vec2& p) {
    constexpr double parts = 1 << sub_pixel_bits;
    return cv::Point(cvRound(parts * (corner.x() + (p.x() + 0.5) * step.x() - 0.5)),
                     cvRound(parts * (corner.y() + (p.y() + 0.5) * step.y() - 0.5)));
  };
  for (const auto& [from, to] : panel.outline) {
    cv::line(target, place(from), place(to), cv::Scalar(255, 184, 46), 1, cv::LINE_AA, sub_pixel_bits);
  }
}

void require_samples(const SlicePanel& panel) {
  if (panel.columns < 1 || panel.rows < 1) {
    throw InputError("a slice has no samples");
  }
  const std::size_t samples = narrow<std::size_t>(panel.columns) * narrow<std::size_t>(panel.rows);
  if (panel.grey.size() != samples || panel.selected.size() != samples) {
    throw InputError(fmt::format("{} and {} values for the {} samples of a slice", panel.grey.size(),
                                 panel.selected.size(), samples));
  }
  require_positive(panel.spacing.x(), "the spacing of a slice's columns");
  require_positive(panel.spacing.y(), "the spacing of a slice's rows");
}

}  // namespace

std::string slice_sheet(const std::vector<SlicePanel>& panels, int columns, int pixels) {
  if (panels.empty() || columns < 1 || pixels < 1) {
    throw InputError(fmt::format("{} slices in {} columns of {} pixels cannot be drawn: one or more of each is needed",
                                 panels.size(), columns, pixels));
  }
  if (const double most = std::max(columns, (narrow<int>(panels.size()) - 1) / columns + 1);
      most * (double{panel_gap} + pixels) > longest_png_side) {
    throw InputError(fmt::format("a sheet of {} slices in {} columns of {} pixels is larger than a PNG can be",
                                 panels.size(), columns, pixels));
  }
  double longest = 0;
  for (const SlicePanel& panel : panels) {
    require_samples(panel);
    longest = std::max({longest, panel.columns * panel.spacing.x(), panel.rows * panel.spacing.y()});
  }
  const int count = narrow<int>(panels.size());
  const int rows = (count + columns - 1) / columns;
  const int width = columns * (pixels + panel_gap) - panel_gap;
  const int height = rows * (pixels + panel_gap) - panel_gap;
  cv::Mat sheet(height, width, CV_8UC3, cv::Scalar::all(16));
  for (int i = 0; i < count; ++i) {
    const cv::Rect place((i % columns) * (pixels + panel_gap), (i / columns) * (pixels + panel_gap), pixels, pixels);
    draw_panel(sheet(place), panels[narrow<std::size_t>(i)], pixels / longest);
  }
  std::vector<unsigned char> bytes;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto& colour = sheet.at<cv::Vec3b>(y, x);
      const bool between = x % (pixels + panel_gap) >= pixels || y % (pixels + panel_gap) >= pixels;
      bytes.insert(bytes.end(), {colour[0], colour[1], colour[2], static_cast<unsigned char>(between ? 0 : 255)});
    }
  }
  return png_of(bytes, width, height);
}

}  // namespace tunica
