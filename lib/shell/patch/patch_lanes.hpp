#pragma once

#include "tunica/core/lanes.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <array>

/// Cubic patches at several places at once.
namespace tunica {

/// A patch in powers of its parameters x = b2, y = b3: 1, x, y, x2, xy, y2, x3, x2y, xy2, y3.
class PatchPowers {
public:
  explicit PatchPowers(const CubicPatch& patch);

  [[nodiscard]] LaneVec3 point(const Lanes& x, const Lanes& y) const;

  /// Derivatives of the point by b2 and by b3.
  [[nodiscard]] std::array<LaneVec3, 2> tangents(const Lanes& x, const Lanes& y) const;

  /// Of the facet: corner 1, and the edges from there to corners 2 and 3.
  [[nodiscard]] const Vec3& corner() const { return c_[0]; }
  [[nodiscard]] const std::array<Vec3, 2>& edges() const { return edges_; }

private:
  std::array<Vec3, 10> c_;
  std::array<Vec3, 2> edges_;
};

/// The same for one place, the coordinates of its point side by side: (x, y, z, 0).
class PatchAxes {
public:
  explicit PatchAxes(const CubicPatch& patch);

  [[nodiscard]] Lanes point(const Vec2& b) const;
  [[nodiscard]] std::array<Lanes, 2> tangents(const Vec2& b) const;
  /// Second derivatives: b2 b2, b2 b3, b3 b3.
  [[nodiscard]] std::array<Lanes, 3> second_derivatives(const Vec2& b) const;

private:
  std::array<Lanes, 10> c_;  // of the powers as in PatchPowers
};

/// A point of a patch near a given one.
struct PatchFoot {
  Vec2 at;
  Vec3 point;
  double squared_distance;
};

/// The point of a patch closest to q, nearly: from a start by at most so many Gauss-Newton steps, Newton's from the
/// third on.
PatchFoot foot_on_patch(const PatchAxes& patch, const Vec3& q, Vec2 start, int most);

/// Nearly the points of a patch closest to q: foot_on_patch() for several.
struct LaneFeet {
  Lanes x, y;
  LaneVec3 point;
  Lanes squared_distance;
};
LaneFeet feet_on_patch(const PatchPowers& patch, const LaneVec3& q);

}  // namespace tunica
