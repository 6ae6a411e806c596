#pragma once

#include "tunica/draw/detail/rasteriser.hpp"

#include <array>
#include <optional>
#include <span>
#include <vector>

/// From where a surface is looked at.
namespace tunica {

/// Pixels, y downward.
struct Box2 {
  double left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] double width() const { return right - left; }
  [[nodiscard]] double height() const { return bottom - top; }
};

/// A camera that fills its part of the picture.
struct View {
  Camera camera;
  Box2 panel;
};

/// Centres the camera on the points (mm, at least one) it sees; their extent to its right and upward, mm.
Vec2 centre_camera(Camera& camera, std::span<const Vec3> points);

/// Two views from opposite sides in the box: along y, x or z, whichever sees the largest side of the points' bounding
/// box (y counts a quarter more than x, and that more than z); beside or above each other, whichever draws them larger.
/// @param points        mm, at least one
/// @param oversampling  pixels of the cameras per pixel of the box
std::array<View, 2> opposite_views(std::span<const Vec3> points, const Box2& box, int oversampling);

/// Views from one place, of as many panels in rows as moments are shown, with room below each for a line. Along the
/// normal of the cut, from where the rest was, or as opposite_views().
std::vector<View> views_of_moments(std::span<const Vec3> points, std::size_t count,
                                   const std::optional<PictureCut>& cut, const Box2& box, int oversampling);

}  // namespace tunica
