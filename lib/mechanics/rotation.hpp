#pragma once

#include "core/types.hpp"

#include <Eigen/Geometry>

#include <cmath>

/// Finite rotations and the derivatives that the co-rotational formulation needs.
/// Source: Nour-Omid, Rankin 1991; Felippa, Haugen 2005, section 5 and appendix.
namespace tunica {

inline Mat3 skew(const Vec3& v) { return (Mat3() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished(); }

/// Unit quaternion of a rotation vector.
inline Eigen::Quaterniond exponential(const Vec3& vector) {
  const double angle = vector.norm();
  const double half = angle / 2;
  const double factor = angle > 1e-5 ? std::sin(half) / angle : 0.5 - angle * angle / 48;
  return {std::cos(half), factor * vector.x(), factor * vector.y(), factor * vector.z()};
}

/// Rotation vector, of length at most pi, of a unit quaternion.
inline Vec3 logarithm(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1 : 1;
  const double sine = q.vec().norm();
  if (sine < 1e-9) {
    return 2 * sign * q.vec();
  }
  return (2 * std::atan2(sine, std::abs(q.w())) / sine * sign) * q.vec();
}

/// Rotation vector, of length at most pi, of a rotation matrix.
inline Vec3 logarithm(const Mat3& rotation) {
  // Small rotations directly, to keep the relative accuracy of their components.
  const Vec3 axis =
      0.5 * Vec3(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0), rotation(1, 0) - rotation(0, 1));
  const double sine = axis.norm();
  const double cosine = (rotation.trace() - 1) / 2;
  if (cosine > 0.5) {
    if (sine < 1e-4) {
      return (1 + sine * sine / 6) * axis;
    }
    return (std::asin(std::min(sine, 1.0)) / sine) * axis;
  }
  return logarithm(Eigen::Quaterniond(rotation));
}

/// eta = (1 - (t/2) cot(t/2)) / t^2 and mu = (d eta / dt) / t at t = |theta|.
struct SpinCoefficients {
  double eta = 0;
  double mu = 0;
};

/// The coefficients for a rotation by `angle` (radians), by their series where it is small.
inline SpinCoefficients spin_coefficients(double angle) {
  const double t2 = angle * angle;
  if (angle < 0.1) {
    return {1.0 / 12 + t2 / 720 + t2 * t2 / 30240 + t2 * t2 * t2 / 1209600,
            1.0 / 360 + t2 / 7560 + t2 * t2 / 201600 + t2 * t2 * t2 / 5987520};
  }
  const double sine = std::sin(angle / 2);
  return {(1 - angle / 2 * std::cos(angle / 2) / sine) / t2,
          (angle * (angle + std::sin(angle)) - 8 * sine * sine) / (4 * t2 * t2 * sine * sine)};
}

/// H(theta): rate of the rotation vector from the spin, both in the fixed frame.
inline Mat3 spin_to_rate(const Vec3& theta) {
  const Mat3 s = skew(theta);
  return Mat3::Identity() - 0.5 * s + spin_coefficients(theta.norm()).eta * s * s;
}

/// Derivative of H(theta)^T m by theta at fixed m.
inline Mat3 spin_to_rate_derivative(const Vec3& theta, const Vec3& m) {
  const auto [eta, mu] = spin_coefficients(theta.norm());
  const Vec3 twice = theta.cross(theta.cross(m));
  return -0.5 * skew(m) + eta * (theta.dot(m) * Mat3::Identity() + theta * m.transpose() - 2 * m * theta.transpose()) +
         mu * twice * theta.transpose();
}

}  // namespace tunica
