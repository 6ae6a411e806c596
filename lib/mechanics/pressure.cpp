#include "mechanics/pressure.hpp"

#include "mechanics/rotation.hpp"

namespace tunica {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Matrix69 = Eigen::Matrix<double, 6, 9>;

/// Share of one corner in -60 times the volume: with edges d and e from the corner to the next ones and its normal N,
///   phi = |d x e|^2 / (N.(d x e)) [ (3/2 - d.e / 2d.d) N.d + (3/2 - d.e / 2e.e) N.e ].
/// It is the integral of the cubic Bezier triangle whose ordinates are -(N.d)/(3 N.n) next to the corner; the centre
/// ordinate is the mean of those that make the slope across one edge linear.
/// A function of six invariants: A = d.d, B = e.e, C = d.e, N.d, N.e, and the triple product.
struct CornerShare {
  double value = 0;
  Vector9 gradient;  ///< by d, e, N
  Matrix9 hessian;
};

bool corner_share(const Vec3& d, const Vec3& e, const Vec3& normal, bool with_hessian, CornerShare& share) {
  const double a = d.squaredNorm(), b = e.squaredNorm(), c = d.dot(e);
  const double nd = normal.dot(d), ne = normal.dot(e);
  const Vec3 cross = d.cross(e);
  const double triple = normal.dot(cross);
  if (!(triple > 0.05 * cross.norm() * normal.norm())) {
    return false;
  }
  const double rho = (a * b - c * c) / triple;
  const double alpha = 1.5 * (nd + ne) - 0.5 * c * (nd / a + ne / b);
  share.value = rho * alpha;
  Vector6 rho1, alpha1;
  rho1 << b / triple, a / triple, -2 * c / triple, 0, 0, -rho / triple;
  alpha1 << 0.5 * c * nd / (a * a), 0.5 * c * ne / (b * b), -0.5 * (nd / a + ne / b), 1.5 - 0.5 * c / a,
      1.5 - 0.5 * c / b, 0;
  const Vector6 first = alpha * rho1 + rho * alpha1;
  Matrix69 jacobian;
  jacobian.setZero();
  jacobian.block<1, 3>(0, 0) = 2 * d.transpose();
  jacobian.block<1, 3>(1, 3) = 2 * e.transpose();
  jacobian.block<1, 3>(2, 0) = e.transpose();
  jacobian.block<1, 3>(2, 3) = d.transpose();
  jacobian.block<1, 3>(3, 0) = normal.transpose();
  jacobian.block<1, 3>(3, 6) = d.transpose();
  jacobian.block<1, 3>(4, 3) = normal.transpose();
  jacobian.block<1, 3>(4, 6) = e.transpose();
  jacobian.block<1, 3>(5, 0) = e.cross(normal).transpose();
  jacobian.block<1, 3>(5, 3) = normal.cross(d).transpose();
  jacobian.block<1, 3>(5, 6) = cross.transpose();
  share.gradient.noalias() = jacobian.transpose() * first;
  if (!with_hessian) {
    return true;
  }
  const double inverse_square = 1 / (triple * triple);
  Matrix6 second = rho1 * alpha1.transpose() + alpha1 * rho1.transpose();
  const auto add = [&second](int i, int j, double value) {
    second(i, j) += value;
    if (i != j) {
      second(j, i) += value;
    }
  };
  add(0, 1, alpha / triple);
  add(2, 2, -2 * alpha / triple);
  add(0, 5, -alpha * b * inverse_square);
  add(1, 5, -alpha * a * inverse_square);
  add(2, 5, 2 * alpha * c * inverse_square);
  add(5, 5, 2 * alpha * rho * inverse_square);
  add(0, 0, -rho * c * nd / (a * a * a));
  add(1, 1, -rho * c * ne / (b * b * b));
  add(0, 2, 0.5 * rho * nd / (a * a));
  add(1, 2, 0.5 * rho * ne / (b * b));
  add(0, 3, 0.5 * rho * c / (a * a));
  add(1, 4, 0.5 * rho * c / (b * b));
  add(2, 3, -0.5 * rho / a);
  add(2, 4, -0.5 * rho / b);
  const Matrix69 product = second * jacobian;
  Matrix9& hessian = share.hessian;
  hessian.noalias() = jacobian.transpose() * product;
  const Mat3 identity = Mat3::Identity();
  hessian.block<3, 3>(0, 0) += 2 * first[0] * identity;
  hessian.block<3, 3>(3, 3) += 2 * first[1] * identity;
  const Mat3 de = first[2] * identity - first[5] * skew(normal);
  const Mat3 dn = first[3] * identity + first[5] * skew(e);
  const Mat3 en = first[4] * identity - first[5] * skew(d);
  hessian.block<3, 3>(0, 3) += de;
  hessian.block<3, 3>(3, 0) += de.transpose();
  hessian.block<3, 3>(0, 6) += dn;
  hessian.block<3, 3>(6, 0) += dn.transpose();
  hessian.block<3, 3>(3, 6) += en;
  hessian.block<3, 3>(6, 3) += en.transpose();
  return true;
}

}  // namespace

bool patch_volume(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals, double& volume,
                  Vector18& gradient, Matrix18* hessian) {
  volume = 0;
  gradient.setZero();
  if (hessian != nullptr) {
    hessian->setZero();
  }
  CornerShare share;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    const Vec3& corner = corners[static_cast<std::size_t>(i)];
    if (!corner_share(corners[static_cast<std::size_t>(j)] - corner, corners[static_cast<std::size_t>(k)] - corner,
                      normals[static_cast<std::size_t>(i)], hessian != nullptr, share)) {
      return false;
    }
    volume -= share.value / 60;
    gradient.segment<3>(3 * i) += (share.gradient.segment<3>(0) + share.gradient.segment<3>(3)) / 60;
    gradient.segment<3>(3 * j) -= share.gradient.segment<3>(0) / 60;
    gradient.segment<3>(3 * k) -= share.gradient.segment<3>(3) / 60;
    gradient.segment<3>(9 + 3 * i) -= share.gradient.segment<3>(6) / 60;
    if (hessian == nullptr) {
      continue;
    }
    // d = x_j - x_i, e = x_k - x_i.
    const std::array<int, 3> place{3 * j, 3 * k, 9 + 3 * i};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const Mat3 block = share.hessian.block<3, 3>(3 * r, 3 * c) / 60;
        hessian->block<3, 3>(place[static_cast<std::size_t>(r)], place[static_cast<std::size_t>(c)]) -= block;
        if (r < 2) {
          hessian->block<3, 3>(3 * i, place[static_cast<std::size_t>(c)]) += block;
        }
        if (c < 2) {
          hessian->block<3, 3>(place[static_cast<std::size_t>(r)], 3 * i) += block;
        }
        if (r < 2 && c < 2) {
          hessian->block<3, 3>(3 * i, 3 * i) -= block;
        }
      }
    }
  }
  return true;
}

bool unit_pressure(const std::array<Vec3, 3>& corners, const std::array<Vec3, 3>& normals, Vector18& force,
                   Matrix18* stiffness) {
  double volume = 0;
  Vector18 gradient;
  Matrix18 hessian;
  if (!patch_volume(corners, normals, volume, gradient, stiffness == nullptr ? nullptr : &hessian)) {
    return false;
  }
  const Vec3 facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]) / 6;
  for (int k = 0; k < 3; ++k) {
    force.segment<3>(6 * k) = facet + gradient.segment<3>(3 * k);
    force.segment<3>(6 * k + 3) = normals[static_cast<std::size_t>(k)].cross(gradient.segment<3>(9 + 3 * k));
  }
  if (stiffness == nullptr) {
    return true;
  }
  // dN = spin x N; moment = N x dV/dN.
  for (int j = 0; j < 3; ++j) {
    const Mat3 turn = -skew(normals[static_cast<std::size_t>(j)]);
    const Mat3 facet_change =
        skew(corners[static_cast<std::size_t>((j + 2) % 3)] - corners[static_cast<std::size_t>((j + 1) % 3)]) / 6;
    for (int i = 0; i < 3; ++i) {
      const Mat3 moment = skew(normals[static_cast<std::size_t>(i)]);
      stiffness->block<3, 3>(6 * i, 6 * j) = hessian.block<3, 3>(3 * i, 3 * j) + facet_change;
      stiffness->block<3, 3>(6 * i, 6 * j + 3) = hessian.block<3, 3>(3 * i, 9 + 3 * j) * turn;
      stiffness->block<3, 3>(6 * i + 3, 6 * j) = moment * hessian.block<3, 3>(9 + 3 * i, 3 * j);
      stiffness->block<3, 3>(6 * i + 3, 6 * j + 3) = moment * hessian.block<3, 3>(9 + 3 * i, 9 + 3 * j) * turn;
    }
    stiffness->block<3, 3>(6 * j + 3, 6 * j + 3) += skew(gradient.segment<3>(9 + 3 * j)) * (-turn);
  }
  return true;
}

}  // namespace tunica
