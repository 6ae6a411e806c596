#include "tunica/draw/detail/view.hpp"

#include "tunica/core/error.hpp"
#include "tunica/draw/picture.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr double gap = 30;  // pixels

struct Side {
  Vec3 towards, up;
  double worth;
};
// Along y with z up a patient is seen from the front and the back.
const std::array<Side, 3> sides{Side{-Vec3::UnitY(), Vec3::UnitZ(), 1}, Side{Vec3::UnitX(), Vec3::UnitZ(), 0.8},
                                Side{Vec3::UnitZ(), -Vec3::UnitY(), 0.7}};

// The side that shows most of the points' bounding box.
const Side& side_of(std::span<const Vec3> points) {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const Vec3& p : points) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  const Vec3 extent = upper - lower;
  return *std::ranges::max_element(sides, {}, [&](const Side& side) {
    return side.worth * std::abs(extent.dot(side.up)) * std::abs(extent.dot(side.up.cross(side.towards)));
  });
}

// Looks at the side `towards`, turned a little to the right and raised, so that depth can be seen.
Camera camera_at(const Vec3& up, const Vec3& towards) {
  constexpr double degree = std::numbers::pi / 180;
  constexpr double turn = 22 * degree;
  constexpr double raise = 14 * degree;
  const Vec3 turned = std::cos(turn) * towards + std::sin(turn) * up.cross(towards);
  Camera camera;
  camera.towards = std::cos(raise) * turned + std::sin(raise) * up;
  camera.right = up.cross(turned);
  camera.up = camera.towards.cross(camera.right);
  return camera;
}

}  // namespace

Vec2 centre_camera(Camera& camera, std::span<const Vec3> points) {
  Vec3 lower = Vec3::Constant(infinity);
  Vec3 upper = -lower;
  for (const Vec3& p : points) {
    const Vec3 seen(camera.right.dot(p), camera.up.dot(p), camera.towards.dot(p));
    lower = lower.cwiseMin(seen);
    upper = upper.cwiseMax(seen);
  }
  const Vec3 middle = 0.5 * (lower + upper);
  camera.centre = middle.x() * camera.right + middle.y() * camera.up + middle.z() * camera.towards;
  return (upper - lower).head<2>();
}

std::array<View, 2> opposite_views(std::span<const Vec3> points, const Box2& box, int oversampling) {
  const Side& side = side_of(points);
  std::array<View, 2> best;
  double best_scale = -1;
  for (const bool beside : {true, false}) {
    const double width = beside ? (box.width() - gap) / 2 : box.width();
    const double height = beside ? box.height() : (box.height() - gap) / 2;
    std::array<View, 2> views;
    double scale = infinity;
    for (const int i : {0, 1}) {
      View& view = views[i];
      view.panel.left = box.left + (beside ? i * (width + gap) : 0);
      view.panel.top = box.top + (beside ? 0 : i * (height + gap));
      view.panel.right = view.panel.left + width;
      view.panel.bottom = view.panel.top + height;
      view.camera = camera_at(side.up, i == 0 ? side.towards : Vec3(-side.towards));
      const Vec2 extent = centre_camera(view.camera, points);
      scale = std::min({scale, width / extent.x(), height / extent.y()});
    }
    if (!std::isfinite(scale)) {
      scale = 1;
    }
    for (View& view : views) {
      view.camera.scale = 0.96 * scale * oversampling;
      view.camera.width = truncated<int>(std::round(view.panel.width())) * oversampling;
      view.camera.height = truncated<int>(std::round(view.panel.height())) * oversampling;
    }
    if (scale > best_scale) {
      best_scale = scale;
      best = views;
    }
  }
  return best;
}

std::vector<View> views_of_moments(std::span<const Vec3> points, std::size_t count,
                                   const std::optional<PictureCut>& cut, const Box2& box, int oversampling) {
  constexpr double room = 44;  // pixels, for the line below
  const Side& side = side_of(points);
  const Vec3 towards = cut ? cut->normal : side.towards;
  const Vec3 away_from = std::abs(towards.z()) < 0.9 ? Vec3(Vec3::UnitZ()) : Vec3(-Vec3::UnitY());
  const Vec3 up = cut ? Vec3((away_from - away_from.dot(towards) * towards).normalized()) : side.up;
  Camera camera = camera_at(up, towards);
  const Vec2 extent = centre_camera(camera, points);
  camera.cut = cut;
  std::size_t columns = 1;
  double scale = -1;
  const auto size = [&](std::size_t of_columns) -> Vec2 {
    const double rows = std::ceil(real(count) / real(of_columns));
    return {(box.width() + gap) / real(of_columns) - gap, (box.height() + gap) / rows - gap - room};
  };
  for (std::size_t n = 1; n <= count; ++n) {
    const double here = (size(n).array() / extent.array()).minCoeff();
    if (std::isfinite(here) && here > scale) {
      scale = here;
      columns = n;
    }
  }
  const Vec2 panel = size(columns).cwiseMax(1);
  camera.scale = (scale > 0 ? 0.96 * scale : 1) * oversampling;
  camera.width = truncated<int>(std::round(panel.x())) * oversampling;
  camera.height = truncated<int>(std::round(panel.y())) * oversampling;
  std::vector<View> views;
  for (std::size_t i = 0; i < count; ++i) {
    const double left = box.left + real(i % columns) * (panel.x() + gap);
    const double top = box.top + real(i / columns) * (panel.y() + gap + room);
    views.push_back({camera, {left, top, left + panel.x(), top + panel.y()}});
  }
  return views;
}

std::array<Vec3, 3> picture_axes(const std::vector<Vec3>& points) {
  constexpr double side = 1000;  // pixels, of each view
  if (points.empty() || !std::ranges::all_of(points, [](const Vec3& p) { return std::isfinite(p.squaredNorm()); })) {
    throw InputError("a view needs points, at finite places");
  }
  const Camera camera = opposite_views(points, {0, 0, 2 * side + gap, side}, 1)[0].camera;
  return {camera.right, camera.up, camera.towards};
}

}  // namespace tunica
