#include "tunica/draw/picture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/draw/detail/rasteriser.hpp"
#include "tunica/draw/detail/ticks.hpp"

#include <fmt/format.h>

#include <png.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double pi = 3.14159265358979323846;
constexpr int picture_width = 1600;
constexpr int picture_height = 900;
// Everything is drawn twice as large and averaged down: smooth edges, lines and letters.
constexpr int oversampling = 2;

const cv::Scalar black(25, 25, 25);
const cv::Scalar grey(115, 115, 115);
const cv::Scalar ring_colour(40, 40, 230);

// ---------------------------------------------------------------------------------------------- drawing, final pixels

enum class Align { left, centre, right };

class Canvas {
public:
  Canvas() : image_(picture_height * oversampling, picture_width * oversampling, CV_8UC3, cv::Scalar::all(255)) {}

  [[nodiscard]] cv::Mat& image() { return image_; }

  [[nodiscard]] double text_width(const std::string& text, double size) const {
    return cv::getTextSize(text, font, font_scale(size), stroke(size), nullptr).width / double(oversampling);
  }

  /// @param size  height of a capital letter in pixels; (x, y) is on the base line
  void text(const std::string& text, double x, double y, double size, const cv::Scalar& colour,
            Align align = Align::left) {
    const double width = text_width(text, size);
    const double left = align == Align::left ? x : align == Align::centre ? x - width / 2 : x - width;
    cv::putText(image_, text, point(left, y), font, font_scale(size), colour, stroke(size), cv::LINE_AA);
  }

  void line(double x0, double y0, double x1, double y1, double width, const cv::Scalar& colour) {
    cv::line(image_, point(x0, y0), point(x1, y1), colour, std::max(1, cvRound(width * oversampling)), cv::LINE_AA);
  }

  void circle(double x, double y, double radius, double width, const cv::Scalar& colour) {
    cv::circle(image_, point(x, y), cvRound(radius * oversampling), colour, std::max(1, cvRound(width * oversampling)),
               cv::LINE_AA);
  }

  void rectangle(double x0, double y0, double x1, double y1, const cv::Scalar& colour) {
    cv::rectangle(image_, point(x0, y0), point(x1, y1) - cv::Point(1, 1), colour, cv::FILLED);
  }

  [[nodiscard]] std::string png() const {
    cv::Mat small;
    cv::resize(image_, small, cv::Size(picture_width, picture_height), 0, 0, cv::INTER_AREA);
    // Not OpenCV's own encoder: its module brings a hundred libraries that every run of a tool would have to load.
    png_image header{};
    header.version = PNG_IMAGE_VERSION;
    header.width = picture_width;
    header.height = picture_height;
    header.format = PNG_FORMAT_BGR;
    std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(header), '\0');
    png_alloc_size_t size = bytes.size();
    if (png_image_write_to_memory(&header, bytes.data(), &size, 0, small.data, 0, nullptr) == 0) {
      throw InternalError(fmt::format("a picture could not be encoded: {}", header.message));
    }
    bytes.resize(size);
    return bytes;
  }

private:
  static constexpr int font = cv::FONT_HERSHEY_SIMPLEX;
  // A capital letter of this font is 21 pixels high at scale 1.
  static double font_scale(double size) { return size * oversampling / 21; }
  static int stroke(double size) { return std::max(1, cvRound(size * oversampling / 9)); }
  static cv::Point point(double x, double y) { return {cvRound(x * oversampling), cvRound(y * oversampling)}; }

  cv::Mat image_;
};

// The font knows ASCII only: every other character becomes one question mark.
std::string ascii(const std::string& text) {
  std::string plain;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      plain += c;
    } else if (byte < 0x80 || byte >= 0xc0) {
      plain += byte < 0x80 ? ' ' : '?';
    }
  }
  return plain;
}

// Shrinks the letters to three quarters, then cuts the middle out, until the text fits.
void draw_fitted(Canvas& canvas, std::string text, double x, double y, double size, double width,
                 const cv::Scalar& colour) {
  const double full = canvas.text_width(text, size);
  size = std::max(0.75 * size, size * std::min(1.0, width / std::max(full, 1.0)));
  if (canvas.text_width(text, size) > width) {
    std::size_t keep = std::min<std::size_t>(text.size(), 1000);
    std::string cut;
    do {
      --keep;
      cut = text.substr(0, keep - keep / 2) + " ... " + text.substr(text.size() - keep / 2);
    } while (keep > 2 && canvas.text_width(cut, size) > width);
    text = cut;
  }
  canvas.text(text, x, y, size, colour);
}

// ------------------------------------------------------------------------------------------------------- point of view

struct Box2 {
  double left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] double width() const { return right - left; }
  [[nodiscard]] double height() const { return bottom - top; }
};

struct Scene {
  const TriangleMesh& mesh;
  std::vector<Index> used;              ///< vertices of triangles
  std::optional<Index> worst;           ///< vertex with the largest value
  Vec3 worst_direction = Vec3::Zero();  ///< the surface's normal there
  Mat3 axes;                            ///< columns: principal axes, the longest extent last
};

struct View {
  Camera camera;
  Box2 panel;
};

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

// Principal axes of the surface's second moments of area, each turned so that its largest component is positive.
Mat3 principal_axes(const TriangleMesh& mesh, const std::vector<Index>& used) {
  Vec3 origin = Vec3::Zero();
  for (const Index v : used) {
    origin += mesh.vertices[v] / real(used.size());
  }
  double total = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const auto& triangle : mesh.triangles) {
    const Vec3 a = mesh.vertices[triangle[0]] - origin;
    const Vec3 b = mesh.vertices[triangle[1]] - origin;
    const Vec3 c = mesh.vertices[triangle[2]] - origin;
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const Vec3 sum = a + b + c;
    total += area;
    first += area / 3 * sum;
    second += area / 12 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (!(total > 0)) {
    return Mat3::Identity();
  }
  Mat3 covariance = second / total - (first / total) * (first / total).transpose();
  // A round body has no principal axes: a thousandth in favour of z upright, seen along y, decides.
  covariance.diagonal() += 1e-3 * covariance.trace() * Vec3(0.5, 0, 1);
  Mat3 axes = Eigen::SelfAdjointEigenSolver<Mat3>(covariance).eigenvectors();
  for (int i = 0; i < 3; ++i) {
    Eigen::Index largest = 0;
    axes.col(i).cwiseAbs().maxCoeff(&largest);
    if (axes(largest, i) < 0) {
      axes.col(i) = -axes.col(i);
    }
  }
  return axes;
}

Vec3 vertex_direction(const TriangleMesh& mesh, Index vertex) {
  Vec3 sum = Vec3::Zero();
  for (const auto& [a, b, c] : mesh.triangles) {
    if (a == vertex || b == vertex || c == vertex) {
      sum += (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    }
  }
  return sum;
}

// A camera that looks at the side `towards`, turned a little to the right and raised, so that depth can be seen.
Camera camera_at(const Vec3& up, const Vec3& towards) {
  const Vec3 right = up.cross(towards);
  const double turn = 22 * pi / 180;
  const double raise = 14 * pi / 180;
  const Vec3 turned = std::cos(turn) * towards + std::sin(turn) * right;
  Camera camera;
  camera.towards = std::cos(raise) * turned + std::sin(raise) * up;
  camera.right = up.cross(turned);
  camera.up = camera.towards.cross(camera.right);
  return camera;
}

// Centres the camera on what it sees and returns the extent in mm.
Vec2 centre_camera(Camera& camera, const Scene& scene) {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const Index v : scene.used) {
    const Vec3& p = scene.mesh.vertices[v];
    const Vec3 seen(camera.right.dot(p), camera.up.dot(p), camera.towards.dot(p));
    lower = lower.cwiseMin(seen);
    upper = upper.cwiseMax(seen);
  }
  const Vec3 middle = 0.5 * (lower + upper);
  camera.centre = middle.x() * camera.right + middle.y() * camera.up + middle.z() * camera.towards;
  return (upper - lower).head<2>();
}

// Two views in the box: beside or above each other, the longest axis upright or level, whichever draws the surface
// largest; an upright z axis is worth some size.
std::array<View, 2> choose_views(const Scene& scene, const Box2& box) {
  constexpr double gap = 30;
  std::array<View, 2> best;
  double best_score = -1;
  for (const bool beside : {true, false}) {
    for (const int upright : {2, 1}) {
      const Vec3 up = scene.axes.col(upright);
      Vec3 towards = scene.axes.col(0);
      if (towards.dot(scene.worst_direction) < 0) {
        towards = -towards;
      }
      std::array<View, 2> views;
      const double width = beside ? (box.width() - gap) / 2 : box.width();
      const double height = beside ? box.height() : (box.height() - gap) / 2;
      double scale = infinity;
      for (std::size_t i = 0; i < 2; ++i) {
        const auto shift = real(i);
        View& view = views[i];
        view.panel.left = box.left + (beside ? shift * (width + gap) : 0);
        view.panel.top = box.top + (beside ? 0 : shift * (height + gap));
        view.panel.right = view.panel.left + width;
        view.panel.bottom = view.panel.top + height;
        view.camera = camera_at(up, i == 0 ? towards : Vec3(-towards));
        const Vec2 extent = centre_camera(view.camera, scene);
        scale = std::min({scale, width / extent.x(), height / extent.y()});
      }
      if (!std::isfinite(scale)) {
        scale = 1;
      }
      for (View& view : views) {
        view.camera.scale = 0.96 * scale * oversampling;
        view.camera.width = cvRound(view.panel.width()) * oversampling;
        view.camera.height = cvRound(view.panel.height()) * oversampling;
      }
      const double score = scale * (0.8 + 0.2 * std::abs(up.z()));
      if (score > best_score) {
        best_score = score;
        best = views;
      }
    }
  }
  return best;
}

// ------------------------------------------------------------------------------------------------------------- colours

using Palette = std::array<cv::Vec3b, 256>;

Palette colour_map() {
  cv::Mat ramp(256, 1, CV_8UC1);
  for (int i = 0; i < 256; ++i) {
    ramp.at<unsigned char>(i) = static_cast<unsigned char>(i);
  }
  cv::Mat coloured;
  cv::applyColorMap(ramp, coloured, cv::COLORMAP_VIRIDIS);
  Palette palette;
  // Lifted towards white: shading on viridis' own darkest colours would hide the shape.
  constexpr double lift = 0.2;
  for (int i = 0; i < 256; ++i) {
    const cv::Vec3b colour = coloured.at<cv::Vec3b>(i);
    for (int c = 0; c < 3; ++c) {
      palette[i][c] = cv::saturate_cast<unsigned char>(colour[c] + lift * (255 - colour[c]));
    }
  }
  return palette;
}

struct Paint {
  Palette palette = colour_map();
  double top = 0;           ///< mm, value of the palette's last colour; 0: no values
  bool plain = false;       ///< no colours at all
  bool inside_out = false;  ///< what faces the viewer is the inner side
};

cv::Vec3b surface_colour(const Paint& paint, float value) {
  if (paint.plain) {
    return {205, 196, 186};
  }
  if (!std::isfinite(value)) {
    return {170, 170, 170};
  }
  const double level = paint.top > 0 ? 255 * value / paint.top : 0;
  return paint.palette[std::lround(std::clamp(level, 0.0, 255.0))];
}

bool on_outline(const Raster& raster, int x, int y, float step) {
  const float own = raster.depth[raster.at(x, y)];
  for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    const int nx = x + dx;
    const int ny = y + dy;
    if (nx >= 0 && ny >= 0 && nx < raster.width && ny < raster.height && own - raster.depth[raster.at(nx, ny)] > step) {
      return true;
    }
  }
  return false;
}

// The raster in colours: diffuse light that leaves the hues readable, dark outlines where the depth jumps.
void paint_raster(cv::Mat target, const Raster& raster, const Paint& paint, double jump) {
  parallel_for_blocks(narrow<std::size_t>(raster.height), 64, [&](std::size_t begin, std::size_t end) {
    for (int y = narrow<int>(begin); y < narrow<int>(end); ++y) {
      auto* row = target.ptr<cv::Vec3b>(y);
      for (int x = 0; x < raster.width; ++x) {
        const std::size_t at = raster.at(x, y);
        if (raster.depth[at] == Raster::empty) {
          continue;
        }
        double light = 0.46 + 0.58 * raster.light[at];
        if ((raster.inner[at] != 0) != paint.inside_out) {
          light *= 0.72;
        }
        if (on_outline(raster, x, y, static_cast<float>(jump))) {
          light *= 0.35;
        }
        const cv::Vec3b colour = surface_colour(paint, raster.value[at]);
        for (int c = 0; c < 3; ++c) {
          row[x][c] = cv::saturate_cast<unsigned char>(light * colour[c]);
        }
      }
    }
  });
}

// Dark lines that lie on the surface, hidden where it hides them.
void paint_lines(cv::Mat target, const Raster& raster, const Camera& camera,
                 const std::vector<std::array<Vec3, 2>>& lines, double bias) {
  std::vector<unsigned char> cover(raster.depth.size(), 0);
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
      // A pen of 2 x 2 pixels: one pixel in the finished picture.
      for (const auto& [dx, dy] : {std::pair{-0.5, -0.5}, {0.5, -0.5}, {-0.5, 0.5}, {0.5, 0.5}}) {
        const double x = std::floor(p.x() + dx);
        const double y = std::floor(p.y() + dy);
        if (x < 0 || y < 0 || x >= raster.width || y >= raster.height) {
          continue;
        }
        const std::size_t at = raster.at(truncated<int>(x), truncated<int>(y));
        if (raster.depth[at] != Raster::empty && p.z() > raster.depth[at] - bias) {
          cover[at] = 1;
        }
      }
    }
  }
  for (int y = 0; y < raster.height; ++y) {
    auto* row = target.ptr<cv::Vec3b>(y);
    for (int x = 0; x < raster.width; ++x) {
      if (cover[raster.at(x, y)] != 0) {
        row[x] = row[x] * 0.45;
      }
    }
  }
}

// ----------------------------------------------------------------------------------------------------- text and scales

void draw_colour_bar(Canvas& canvas, const Paint& paint, const PictureOptions& options, double largest) {
  constexpr double left = 1432, right = 1466, top = 190, bottom = 800;
  const double middle = (left + right) / 2;
  const std::string quantity = ascii(options.quantity);
  constexpr double right_margin = 1590;
  const double centre = std::min(middle, right_margin - canvas.text_width(quantity, 15) / 2);
  canvas.text(quantity, centre, top - 72, 15, black, Align::centre);
  for (int i = 0; i < 256; ++i) {
    const double y0 = bottom + (top - bottom) * i / 256;
    const double y1 = bottom + (top - bottom) * (i + 1) / 256;
    const cv::Vec3b colour = paint.palette[i];
    canvas.rectangle(left, y1, right, y0, cv::Scalar(colour[0], colour[1], colour[2]));
  }
  const auto place = [&](double part) { return bottom + (top - bottom) * part; };
  canvas.text("mm", right + 14, top - 24, 15, black);
  for (const double tick : round_ticks(0, paint.top, 7)) {
    const double y = place(paint.top > 0 ? tick / paint.top : 0);
    canvas.line(right, y, right + 8, y, 1.2, black);
    canvas.text(tick_text(tick, round_step(0, paint.top, 7)), right + 14, y + 6, 15, black);
  }
  if (options.diagonal) {
    const double top_percent = 100 * paint.top / *options.diagonal;
    canvas.text("% of", left - 14, top - 44, 13, grey, Align::right);
    canvas.text("diagonal", left - 14, top - 24, 13, grey, Align::right);
    for (const double tick : round_ticks(0, top_percent, 7)) {
      const double y = place(top_percent > 0 ? tick / top_percent : 0);
      canvas.line(left - 8, y, left, y, 1.2, grey);
      canvas.text(tick_text(tick, round_step(0, top_percent, 7)), left - 14, y + 6, 15, grey, Align::right);
    }
  }
  if (largest > paint.top) {
    canvas.text(fmt::format("brightest: above {}", short_number(paint.top)), middle, bottom + 40, 12, grey,
                Align::centre);
  }
}

// The axes of the mesh's own frame as this camera sees them, the ones that point away first.
void draw_axes(Canvas& canvas, const View& view) {
  constexpr double length = 26;
  const double x = view.panel.left + 34;
  const double y = view.panel.bottom - 34;
  std::array<int, 3> order{0, 1, 2};
  std::ranges::sort(order, [&](int i, int j) { return view.camera.towards[i] < view.camera.towards[j]; });
  for (const int i : order) {
    const double dx = length * view.camera.right[i];
    const double dy = -length * view.camera.up[i];
    canvas.line(x, y, x + dx, y + dy, 1.6, grey);
    const double reach = std::hypot(dx, dy);
    if (reach > 0.3 * length) {
      const double away = (reach + 9) / reach;
      canvas.text(std::string(1, "xyz"[i]), x + away * dx, y + away * dy + 4, 11, grey, Align::centre);
    }
  }
}

void draw_length_scale(Canvas& canvas, const View& view, const Box2& box) {
  const double pixels_per_mm = view.camera.scale / oversampling;
  const double length = round_below(200 / pixels_per_mm);
  const double width = length * pixels_per_mm;
  const double x = box.left + 4;
  const double y = picture_height - 24;
  canvas.line(x, y, x + width, y, 2, black);
  canvas.line(x, y - 5, x, y + 5, 2, black);
  canvas.line(x + width, y - 5, x + width, y + 5, 2, black);
  canvas.text(fmt::format("{} mm", short_number(length)), x + width + 12, y + 6, 13, black);
}

// A ring where the largest value is, in a view that shows the place.
void mark_worst(Canvas& canvas, const View& view, const Raster& raster, const Vec3& place, double tolerance) {
  const Vec3 seen = view.camera.project(place);
  const int x = std::clamp(cvFloor(seen.x()), 0, raster.width - 1);
  const int y = std::clamp(cvFloor(seen.y()), 0, raster.height - 1);
  if (seen.z() < raster.depth[raster.at(x, y)] - tolerance) {
    return;
  }
  const double px = view.panel.left + seen.x() / oversampling;
  const double py = view.panel.top + seen.y() / oversampling;
  canvas.circle(px, py, 13, 4.5, cv::Scalar::all(255));
  canvas.circle(px, py, 13, 2.5, ring_colour);
}

std::string draw(const TriangleMesh& surface, const std::vector<double>& values, const PictureOptions& options) {
  TUNICA_ASSERT(!surface.triangles.empty());
  TUNICA_ASSERT(values.empty() || values.size() == surface.vertices.size());
  Scene scene{surface, used_vertices(surface), {}, Vec3::Zero(), Mat3::Identity()};
  double largest = 0;
  if (!values.empty()) {
    for (const Index v : scene.used) {
      if (std::isfinite(values[v]) && (!scene.worst || values[v] > values[*scene.worst])) {
        scene.worst = v;
      }
    }
    largest = scene.worst ? std::max(0.0, values[*scene.worst]) : 0;
  }
  scene.axes = principal_axes(surface, scene.used);
  Paint paint;
  paint.inside_out = turned_inside_out(surface, scene.used);
  if (scene.worst) {
    scene.worst_direction = (paint.inside_out ? -1 : 1) * vertex_direction(surface, *scene.worst);
  }
  paint.plain = values.empty();
  paint.top = options.maximum.value_or(largest);

  const bool headed = !options.title.empty() || !options.caption.empty() || !paint.plain;
  const Box2 box{36, headed ? 116.0 : 36.0, paint.plain ? picture_width - 36.0 : 1310.0, picture_height - 60.0};
  const std::array<View, 2> views = choose_views(scene, box);
  const auto normals = shading_normals(surface);
  Canvas canvas;
  for (const View& view : views) {
    const Raster raster = rasterise(surface, normals, values, view.camera);
    const cv::Rect area(cvRound(view.panel.left) * oversampling, cvRound(view.panel.top) * oversampling, raster.width,
                        raster.height);
    const double pixel = 1 / view.camera.scale;
    paint_raster(canvas.image()(area), raster, paint, 14 * pixel);
    paint_lines(canvas.image()(area), raster, view.camera, options.lines, 4 * pixel);
    if (scene.worst && largest > 0) {
      mark_worst(canvas, view, raster, surface.vertices[*scene.worst], 6 * pixel);
    }
    draw_axes(canvas, view);
  }
  draw_length_scale(canvas, views[0], box);

  std::string title = ascii(options.title);
  if (!paint.plain) {
    title += fmt::format("{}largest {} mm", title.empty() ? "" : ": ", short_number(largest));
    if (options.diagonal) {
      title += fmt::format(" ({} % of the diagonal)", short_number(100 * largest / *options.diagonal));
    }
    draw_colour_bar(canvas, paint, options, largest);
  }
  draw_fitted(canvas, title, 40, 54, 21, picture_width - 80, black);
  draw_fitted(canvas, ascii(options.caption), 40, 90, 14, picture_width - 80, grey);
  return canvas.png();
}

// OpenCV reports an error to the terminal before it throws.
std::string draw_quietly(const TriangleMesh& surface, const std::vector<double>& values_mm,
                         const PictureOptions& options) {
  cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  try {
    return draw(surface, values_mm, options);
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) {
      throw std::bad_alloc();
    }
    throw InternalError(fmt::format("a picture cannot be drawn: {}", error.err));
  }
}

}  // namespace

std::string error_map_picture(const TriangleMesh& surface, const std::vector<double>& values_mm,
                              const PictureOptions& options) {
  TUNICA_ASSERT(values_mm.size() == surface.vertices.size());
  TUNICA_ASSERT(!options.diagonal || *options.diagonal > 0);
  return draw_quietly(surface, values_mm, options);
}

std::string surface_picture(const TriangleMesh& surface, const PictureOptions& options) {
  return draw_quietly(surface, {}, options);
}

std::array<double, 3> bar_colour(double part) {
  static const Paint paint{.top = 1};
  const cv::Vec3b colour = surface_colour(paint, static_cast<float>(part));
  return {colour[2] / 255.0, colour[1] / 255.0, colour[0] / 255.0};  // OpenCV's begin with blue
}

}  // namespace tunica
