#pragma once

#include "tunica/core/types.hpp"

#include <Eigen/Geometry>

#include <cmath>
#include <optional>

namespace tunica {

/// Weighted sum of squared distances to planes: q(p) = p' A p + 2 b' p + c (Garland, Heckbert, Surface simplification
/// using quadric error metrics, SIGGRAPH 1997).
struct Quadric {
  static constexpr double least_determinant = 1e-18;  ///< of A, relative to its trace cubed: below it is singular

  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;  // A
  double bx = 0, by = 0, bz = 0;
  double c = 0;

  /// The plane through `point` with unit normal `n`.
  static Quadric plane(const Vec3& n, const Vec3& point, double weight) {
    const double d = -n.dot(point);
    const Vec3 w = weight * n;
    return {w.x() * n.x(), w.x() * n.y(), w.x() * n.z(), w.y() * n.y(), w.y() * n.z(),
            w.z() * n.z(), w.x() * d,     w.y() * d,     w.z() * d,     weight * d * d};
  }

  /// The squared distance to a point.
  static Quadric point(const Vec3& p, double weight) {
    const Vec3 b = -weight * p;
    return {weight, 0, 0, weight, 0, weight, b.x(), b.y(), b.z(), weight * p.squaredNorm()};
  }

  Quadric& operator+=(const Quadric& o) {
    xx += o.xx;
    xy += o.xy;
    xz += o.xz;
    yy += o.yy;
    yz += o.yz;
    zz += o.zz;
    bx += o.bx;
    by += o.by;
    bz += o.bz;
    c += o.c;
    return *this;
  }
  friend Quadric operator+(Quadric l, const Quadric& r) { return l += r; }

  [[nodiscard]] Quadric times(double f) const {
    return {f * xx, f * xy, f * xz, f * yy, f * yz, f * zz, f * bx, f * by, f * bz, f * c};
  }

  /// A p.
  [[nodiscard]] Vec3 times(const Vec3& p) const {
    return {xx * p.x() + xy * p.y() + xz * p.z(), xy * p.x() + yy * p.y() + yz * p.z(),
            xz * p.x() + yz * p.y() + zz * p.z()};
  }

  [[nodiscard]] double operator()(const Vec3& p) const {
    return p.dot(times(p)) + 2 * (bx * p.x() + by * p.y() + bz * p.z()) + c;
  }

  /// Half the gradient at p.
  [[nodiscard]] Vec3 half_gradient(const Vec3& p) const { return times(p) + Vec3(bx, by, bz); }

  [[nodiscard]] double trace() const { return xx + yy + zz; }

  /// The minimum, pulled towards `start` by `pull` times the trace so that it exists and stays near on flat ground.
  [[nodiscard]] std::optional<Vec3> minimum(const Vec3& start, double pull) const {
    const double shift = pull * trace();
    const double a = xx + shift;
    const double d = yy + shift;
    const double f = zz + shift;
    // Cofactors of the symmetric matrix.
    const double c00 = d * f - yz * yz;
    const double c01 = xz * yz - xy * f;
    const double c02 = xy * yz - xz * d;
    const double determinant = a * c00 + xy * c01 + xz * c02;
    const double size = trace();
    if (!(determinant > least_determinant * size * size * size)) {
      return std::nullopt;
    }
    const double c11 = a * f - xz * xz;
    const double c12 = xy * xz - a * yz;
    const double c22 = a * d - xy * xy;
    const Vec3 g = half_gradient(start);
    const Vec3 step(c00 * g.x() + c01 * g.y() + c02 * g.z(), c01 * g.x() + c11 * g.y() + c12 * g.z(),
                    c02 * g.x() + c12 * g.y() + c22 * g.z());
    return start - step / determinant;
  }
};

}  // namespace tunica
