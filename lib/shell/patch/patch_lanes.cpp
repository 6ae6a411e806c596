#include "tunica/shell/patch/patch_lanes.hpp"

namespace tunica {
namespace {

constexpr int steps = 2;            // Gauss-Newton's
constexpr double singular = 1e-14;  // determinant of a patch's metric, relative
constexpr double arrival = 1e-6;    // in a patch's parameters: a step to the foot that is the last

Lanes dot(const LaneVec3& a, const LaneVec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Lanes dot(const LaneVec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Of places side by side, as in PatchAxes.
double dot(const Lanes& a, const Lanes& b) { return simd::reduce(a * b); }

Vec2 inside(Vec2 b) {
  b = b.cwiseMax(0);
  const double sum = b[0] + b[1];
  return sum > 1 ? Vec2(b / sum) : b;
}

LaneVec3 minus(const LaneVec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Into the triangle.
void clamp_inside(Lanes& x, Lanes& y) {
  x = simd::max(x, Lanes(0.0));
  y = simd::max(y, Lanes(0.0));
  const Lanes shrink = 1.0 / simd::max(x + y, Lanes(1.0));
  x *= shrink;
  y *= shrink;
}

Lanes chosen(const LaneMask& mask, const Lanes& yes, Lanes no) {
  simd::where(mask, no) = yes;
  return no;
}

/// Coefficients of 1, x, y, x2, xy, y2, x3, x2y, xy2, y3.
std::array<Vec3, 10> powers(const CubicPatch& patch) {
  const auto& p = patch.control;
  return {p[0],
          3 * (p[3] - p[0]),
          3 * (p[8] - p[0]),
          3 * (p[4] - 2 * p[3] + p[0]),
          6 * (p[9] - p[3] - p[8] + p[0]),
          3 * (p[7] - 2 * p[8] + p[0]),
          p[1] - p[0] + 3 * (p[3] - p[4]),
          3 * (p[5] - p[4] + 2 * (p[3] - p[9]) + p[8] - p[0]),
          3 * (p[6] - p[7] + 2 * (p[8] - p[9]) + p[3] - p[0]),
          p[2] - p[0] + 3 * (p[8] - p[7])};
}

}  // namespace

PatchPowers::PatchPowers(const CubicPatch& patch)
    : c_(powers(patch)), edges_{patch.control[1] - patch.control[0], patch.control[2] - patch.control[0]} {}

LaneVec3 PatchPowers::point(const Lanes& x, const Lanes& y) const {
  const Lanes xy = x * y;
  LaneVec3 result;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto c = [&](std::size_t k) { return c_[k][i]; };
    result[i] = c(0) + x * (c(1) + x * (c(3) + x * c(6))) + y * (c(2) + y * (c(5) + y * c(9))) +
                xy * (c(4) + x * c(7) + y * c(8));
  }
  return result;
}

std::array<LaneVec3, 2> PatchPowers::tangents(const Lanes& x, const Lanes& y) const {
  std::array<LaneVec3, 2> result;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto c = [&](std::size_t k) { return c_[k][i]; };
    result[0][i] = c(1) + x * (2 * c(3) + 3 * c(6) * x) + y * (c(4) + 2 * c(7) * x + c(8) * y);
    result[1][i] = c(2) + y * (2 * c(5) + 3 * c(9) * y) + x * (c(4) + c(7) * x + 2 * c(8) * y);
  }
  return result;
}

PatchAxes::PatchAxes(const CubicPatch& patch) {
  const auto c = powers(patch);
  for (std::size_t i = 0; i < c.size(); ++i) {
    c_[i] = lanes_of([&](std::size_t k) { return k < 3 ? c[i][k] : 0.0; });
  }
}

Lanes PatchAxes::point(const Vec2& b) const {
  const double x = b[0], y = b[1];
  return c_[0] + x * (c_[1] + x * (c_[3] + x * c_[6])) + y * (c_[2] + y * (c_[5] + y * c_[9])) +
         (x * y) * (c_[4] + x * c_[7] + y * c_[8]);
}

std::array<Lanes, 2> PatchAxes::tangents(const Vec2& b) const {
  const double x = b[0], y = b[1];
  return {c_[1] + (2 * x) * c_[3] + (3 * x * x) * c_[6] + y * (c_[4] + (2 * x) * c_[7] + y * c_[8]),
          c_[2] + (2 * y) * c_[5] + (3 * y * y) * c_[9] + x * (c_[4] + x * c_[7] + (2 * y) * c_[8])};
}

std::array<Lanes, 3> PatchAxes::second_derivatives(const Vec2& b) const {
  const double x = b[0], y = b[1];
  return {2.0 * (c_[3] + (3 * x) * c_[6] + y * c_[7]), c_[4] + 2.0 * (x * c_[7] + y * c_[8]),
          2.0 * (c_[5] + (3 * y) * c_[9] + x * c_[8])};
}

PatchFoot foot_on_patch(const PatchAxes& patch, const Vec3& q, Vec2 start, int most) {
  const Lanes wanted = lanes_of([&](std::size_t k) { return k < 3 ? q[k] : 0.0; });
  Vec2 at = start;
  Lanes point = patch.point(at);
  Lanes r = wanted - point;
  double least = dot(r, r);
  for (int i = 0; i < most; ++i) {
    const auto d = patch.tangents(at);
    double a = dot(d[0], d[0]), b = dot(d[0], d[1]), e = dot(d[1], d[1]);
    const double f = dot(d[0], r), g = dot(d[1], r);
    if (i >= steps) {
      // What is left after these is the curvature's doing.
      const auto h = patch.second_derivatives(at);
      const double a2 = a - dot(h[0], r), b2 = b - dot(h[1], r), e2 = e - dot(h[2], r);
      if (a2 > 0 && a2 * e2 - b2 * b2 > 1e-3 * (a * e - b * b)) {
        a = a2;
        b = b2;
        e = e2;
      }
    }
    const double det = a * e - b * b;
    if (!(det > 1e-14 * a * e)) {
      break;
    }
    Vec2 next = at + Vec2((e * f - b * g) / det, (a * g - b * f) / det);
    if (next[0] < 0 || next[1] < 0 || next[0] + next[1] > 1) {
      // Along the border that is crossed the step is taken anew.
      next = inside(next);
      const Vec2 along = next[0] <= 0 ? Vec2(0, 1) : next[1] <= 0 ? Vec2(1, 0) : Vec2(-1, 1);
      const auto dn = patch.tangents(next);
      const Lanes tangent = along[0] * dn[0] + along[1] * dn[1];
      next =
          inside(next + along * (dot(tangent, wanted - patch.point(next)) / std::max(dot(tangent, tangent), 1e-300)));
    }
    const Lanes p = patch.point(next);
    const Lanes rest = wanted - p;
    const double squared = dot(rest, rest);
    if (squared >= least) {
      break;
    }
    const bool arrived = (next - at).squaredNorm() < arrival * arrival;
    at = next;
    point = p;
    r = rest;
    least = squared;
    if (arrived) {
      break;
    }
  }
  return {at, Vec3(point[0], point[1], point[2]), least};
}

LaneFeet feet_on_patch(const PatchPowers& patch, const LaneVec3& q) {
  const auto& [u, v] = patch.edges();
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v);
  const double inverse = 1 / std::max(uu * vv - uv * uv, 1e-300);
  const LaneVec3 w = minus(q, patch.corner());
  const Lanes wu = dot(w, u), wv = dot(w, v);
  LaneFeet best{(vv * wu - uv * wv) * inverse, (uu * wv - uv * wu) * inverse, {}, {}};
  clamp_inside(best.x, best.y);
  best.point = patch.point(best.x, best.y);
  LaneVec3 r = q - best.point;
  best.squared_distance = dot(r, r);
  LaneMask going(true);
  for (int i = 0; i < steps; ++i) {
    const auto [dx, dy] = patch.tangents(best.x, best.y);
    const Lanes a = dot(dx, dx), b = dot(dx, dy), e = dot(dy, dy), f = dot(dx, r), g = dot(dy, r);
    const Lanes determinant = a * e - b * b;
    going = going && determinant > singular * a * e;
    const Lanes scale = 1.0 / chosen(going, determinant, Lanes(1.0));
    Lanes x = best.x + (e * f - b * g) * scale, y = best.y + (a * g - b * f) * scale;
    const LaneMask outside = x < 0.0 || y < 0.0 || x + y > 1.0;
    if (simd::any_of(outside && going)) {
      // Along the border that is crossed the step is taken anew.
      Lanes bx = x, by = y;
      clamp_inside(bx, by);
      const LaneMask on_first = bx <= 0.0, on_second = !on_first && by <= 0.0;
      const Lanes ax = chosen(on_first, Lanes(0.0), chosen(on_second, Lanes(1.0), Lanes(-1.0)));
      const Lanes ay = chosen(on_second, Lanes(0.0), Lanes(1.0));
      const auto [ex, ey] = patch.tangents(bx, by);
      const LaneVec3 tangent = ax * ex + ay * ey;
      const LaneVec3 rest = q - patch.point(bx, by);
      const Lanes along = dot(tangent, rest) / simd::max(dot(tangent, tangent), Lanes(1e-300));
      bx += along * ax;
      by += along * ay;
      clamp_inside(bx, by);
      x = chosen(outside, bx, x);
      y = chosen(outside, by, y);
    }
    const LaneVec3 point = patch.point(x, y);
    const LaneVec3 left = q - point;
    const Lanes squared = dot(left, left);
    going = going && squared < best.squared_distance;
    if (simd::none_of(going)) {
      break;
    }
    const Lanes mx = x - best.x, my = y - best.y;
    const LaneMask on_its_way = mx * mx + my * my >= arrival * arrival;
    best.x = chosen(going, x, best.x);
    best.y = chosen(going, y, best.y);
    best.squared_distance = chosen(going, squared, best.squared_distance);
    for (Eigen::Index k = 0; k < 3; ++k) {
      best.point[k] = chosen(going, point[k], best.point[k]);
      r[k] = chosen(going, left[k], r[k]);
    }
    going = going && on_its_way;
  }
  return best;
}

}  // namespace tunica
