#pragma once

#include "tunica/core/types.hpp"

#include <Eigen/Geometry>

#include <cmath>

/// Finite rotations and the derivatives that the co-rotational formulation needs.
/// Source: Nour-Omid, Rankin 1991; Felippa, Haugen 2005, section 5 and appendix.
namespace tunica {

template <typename Vector>
auto skew(const Eigen::MatrixBase<Vector>& v) {
  using Scalar = typename Vector::Scalar;
  Eigen::Matrix<Scalar, 3, 3> s;
  s << Scalar(0), -v[2], v[1], v[2], Scalar(0), -v[0], -v[1], v[0], Scalar(0);
  return s;
}

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
template <typename Scalar>
struct SpinCoefficients {
  Scalar eta = 0;
  Scalar mu = 0;
};

/// Squared angle below which small_spin_coefficients() are exact to round-off (rad^2).
inline constexpr double small_square = 0.01;

/// The coefficients by their series, for a small squared angle.
template <typename Scalar>
SpinCoefficients<Scalar> small_spin_coefficients(const Scalar& t2) {
  return {1.0 / 12 + t2 * (1.0 / 720 + t2 * (1.0 / 30240 + t2 * (1.0 / 1209600))),
          1.0 / 360 + t2 * (1.0 / 7560 + t2 * (1.0 / 201600 + t2 * (1.0 / 5987520)))};
}

/// The coefficients for a squared angle (rad^2).
inline SpinCoefficients<double> spin_coefficients(double t2) {
  if (t2 < small_square) {
    return small_spin_coefficients(t2);
  }
  const double angle = std::sqrt(t2);
  const double sine = std::sin(angle / 2);
  return {(1 - angle / 2 * std::cos(angle / 2) / sine) / t2,
          (angle * (angle + std::sin(angle)) - 8 * sine * sine) / (4 * t2 * t2 * sine * sine)};
}

/// H(theta): rate of the rotation vector from the spin, both in the fixed frame.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 3> spin_to_rate(const Eigen::Matrix<Scalar, 3, 1>& theta, const Scalar& eta) {
  const Eigen::Matrix<Scalar, 3, 3> s = skew(theta);
  return Eigen::Matrix<Scalar, 3, 3>::Identity() - 0.5 * s + eta * (s * s);
}

/// Derivative of H(theta)^T m by theta at fixed m.
template <typename Scalar>
Eigen::Matrix<Scalar, 3, 3> spin_to_rate_derivative(const Eigen::Matrix<Scalar, 3, 1>& theta,
                                                    const Eigen::Matrix<Scalar, 3, 1>& m,
                                                    const SpinCoefficients<Scalar>& coefficients) {
  const Eigen::Matrix<Scalar, 3, 1> twice = theta.cross(theta.cross(m));
  return -0.5 * skew(m) +
         coefficients.eta * (theta.dot(m) * Eigen::Matrix<Scalar, 3, 3>::Identity() + theta * m.transpose() -
                             2 * m * theta.transpose()) +
         coefficients.mu * (twice * theta.transpose());
}

}  // namespace tunica
