#include "tunica/mechanics/solids/solid_element.hpp"

#include "tunica/mechanics/elements/rotation.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

using Matrix99 = Eigen::Matrix<double, 9, 9>;

Mat3 cofactors(const Mat3& f) {
  Mat3 c;
  c << f.col(1).cross(f.col(2)), f.col(2).cross(f.col(0)), f.col(0).cross(f.col(1));
  return c;
}

/// The rotation next to a matrix of positive determinant, by Newton's method. Source: Higham 1986.
Mat3 nearest_rotation(const Mat3& f) {
  Mat3 r = f;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Mat3 next = 0.5 * (r + cofactors(r) / r.determinant());
    const double change = (next - r).squaredNorm();
    r = next;
    if (change < 1e-30) {
      break;
    }
  }
  return r;
}

/// At a deformation gradient: stress P and volume strain theta with their derivatives.
struct Point {
  Mat3 stress;             ///< of W: first Piola-Kirchhoff
  Mat3 volume_derivative;  ///< of theta by F
  double volume_strain = 0;
  double energy = 0;    ///< W
  Matrix99 derivative;  ///< of P + p d theta, by columns of F
};

/// factor times the derivative of the cofactors: a column of F enters two of the cross products.
void add_cofactor_derivative(const Mat3& f, double factor, Matrix99& derivative) {
  for (int l = 0; l < 3; ++l) {
    derivative.block<3, 3>(3 * ((l + 2) % 3), 3 * l) -= factor * skew(f.col((l + 1) % 3));
    derivative.block<3, 3>(3 * ((l + 1) % 3), 3 * l) += factor * skew(f.col((l + 2) % 3));
  }
}

/// What the law makes of a deformation; the prestress is not in it.
bool at_point_of_law(const SolidElement& e, const Mat3& gradient, double pressure, Point& at, bool with_derivative) {
  const Mat3 f = Mat3::Identity() + gradient;
  const double determinant = f.determinant();
  if (!(determinant > 0)) {
    return false;
  }
  const double mu = e.shear;
  const double lambda = e.bulk_of_displacement - 2 * mu / 3;
  // J - 1 and |F|^2 - 3 from the displacement's gradient, so that small strains keep their digits.
  const double trace = gradient.trace();
  at.volume_strain = trace + (trace * trace - (gradient * gradient).trace()) / 2 + gradient.determinant();
  at.volume_derivative = cofactors(f);
  if (e.law == SolidLaw::neo_hookean) {
    at.volume_strain = std::log1p(at.volume_strain);
    at.volume_derivative /= determinant;
    const double on_volume = lambda * at.volume_strain - mu;
    at.energy =
        mu * (trace + gradient.squaredNorm() / 2 - at.volume_strain) + lambda / 2 * at.volume_strain * at.volume_strain;
    at.stress = mu * (f - at.volume_derivative) + lambda * at.volume_strain * at.volume_derivative;
    if (with_derivative) {
      at.derivative.setIdentity();
      at.derivative *= mu;
      const Eigen::Map<const Eigen::Matrix<double, 9, 1>> c(at.volume_derivative.data());
      at.derivative += (lambda - on_volume - pressure) * c * c.transpose();
      add_cofactor_derivative(f, (on_volume + pressure) / determinant, at.derivative);
    }
    return true;
  }
  const Mat3 r = nearest_rotation(f);
  const Mat3 strain = r.transpose() * f - Mat3::Identity();
  const double trace_of_strain = strain.trace();
  at.energy = mu * strain.squaredNorm() + lambda / 2 * trace_of_strain * trace_of_strain;
  at.stress = 2 * mu * (f - r) + lambda * trace_of_strain * r;
  if (with_derivative) {
    const Mat3 stretch = strain + Mat3::Identity();
    const Mat3 spin = (stretch.trace() * Mat3::Identity() - stretch).inverse();
    const double on_rotation = lambda * trace_of_strain - 2 * mu;
    for (int l = 0; l < 3; ++l) {
      for (int j = 0; j < 3; ++j) {
        Mat3 change = Mat3::Zero();
        change(j, l) = 1;
        const Mat3 turned = r.transpose() * change;
        const Vec3 axial(turned(2, 1) - turned(1, 2), turned(0, 2) - turned(2, 0), turned(1, 0) - turned(0, 1));
        const Mat3 of_rotation = r * skew(spin * axial);
        const Mat3 of_stress = 2 * mu * change + lambda * r(j, l) * r + on_rotation * of_rotation;
        at.derivative.col(3 * l + j) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(of_stress.data());
      }
    }
    add_cofactor_derivative(f, pressure, at.derivative);
  }
  return true;
}

bool at_point(const SolidElement& e, const Mat3& gradient, double pressure, Point& at, bool with_derivative) {
  if (!at_point_of_law(e, gradient, pressure, at, with_derivative)) {
    return false;
  }
  at.energy += e.prestress.cwiseProduct(gradient + 0.5 * gradient.transpose() * gradient).sum();
  at.stress += (Mat3::Identity() + gradient) * e.prestress;
  for (int l = 0; with_derivative && l < 3; ++l) {
    for (int m = 0; m < 3; ++m) {
      at.derivative.block<3, 3>(3 * l, 3 * m).diagonal().array() += e.prestress(l, m);
    }
  }
  return true;
}

/// M and S of the header over the volume, entry (i, j).
double mass(bool same) { return same ? 0.1 : 0.05; }
double unstable_part(bool same) { return mass(same) - 1.0 / 16; }

}  // namespace

SolidElement make_solid_element(const Corners4& corners, const Material& material, SolidLaw law) {
  SolidElement e;
  e.law = law;
  Mat3 edges;
  for (int k = 0; k < 3; ++k) {
    edges.col(k) = corners.col(k + 1) - corners.col(0);
  }
  e.volume = edges.determinant() / 6;
  const Mat3 inverse = edges.inverse();
  for (int k = 0; k < 3; ++k) {
    e.gradients.col(k + 1) = inverse.row(k).transpose();
  }
  e.gradients.col(0) = -e.gradients.rightCols<3>().rowwise().sum();
  e.shear = material.young / (2 * (1 + material.poisson));
  const double bulk = material.young / (3 * (1 - 2 * material.poisson));
  e.bulk_of_displacement = std::min(e.shear, bulk / 2);
  e.bulk_of_pressure = bulk - e.bulk_of_displacement;
  return e;
}

bool solid_response(const SolidElement& e, const SolidMotion& motion, SolidResponse& response, Matrix16* tangent) {
  const Mat3 gradient = motion.displacement * e.gradients.transpose();
  const Eigen::Vector4d p = e.shear * motion.pressure;
  Point at;
  if (!at_point(e, gradient, p.mean(), at, tangent != nullptr)) {
    return false;
  }
  const double v = e.volume;
  const Mat3 stress = at.stress + p.mean() * at.volume_derivative;
  response.energy = v * (at.energy + p.mean() * at.volume_strain);
  const Corners4 force = v * stress * e.gradients;
  const Corners4 of_volume = v * at.volume_derivative * e.gradients;
  for (int i = 0; i < 4; ++i) {
    response.force.segment<3>(4 * i) = force.col(i);
    double row = v / 4 * at.volume_strain;
    for (int j = 0; j < 4; ++j) {
      const double compliance = v * (mass(i == j) / e.bulk_of_pressure + unstable_part(i == j) / e.shear);
      row -= compliance * p[j];
      response.energy -= compliance / 2 * p[i] * p[j];
      if (tangent != nullptr) {
        (*tangent)(4 * i + 3, 4 * j + 3) = -compliance * e.shear * e.shear;
      }
    }
    response.force[4 * i + 3] = e.shear * row;
  }
  if (tangent != nullptr) {
    for (int j = 0; j < 4; ++j) {
      Eigen::Matrix<double, 9, 3> columns = Eigen::Matrix<double, 9, 3>::Zero();
      for (int l = 0; l < 3; ++l) {
        columns += v * e.gradients(l, j) * at.derivative.middleCols<3>(3 * l);
      }
      for (int i = 0; i < 4; ++i) {
        Mat3 block = Mat3::Zero();
        for (int k = 0; k < 3; ++k) {
          block += e.gradients(k, i) * columns.middleRows<3>(3 * k);
        }
        tangent->block<3, 3>(4 * i, 4 * j) = block;
        tangent->block<3, 1>(4 * i, 4 * j + 3) = e.shear / 4 * of_volume.col(i);
        tangent->block<1, 3>(4 * j + 3, 4 * i) = e.shear / 4 * of_volume.col(i).transpose();
      }
    }
  }
  return true;
}

Matrix16 linear_stiffness(const SolidElement& element) {
  SolidElement bare = element;
  bare.prestress.setZero();
  SolidResponse unused;
  Matrix16 tangent;
  solid_response(bare, {Corners4::Zero(), Eigen::Vector4d::Zero()}, unused, &tangent);
  return tangent;
}

Vector16 linear_force(const SolidElement& element, const Vector16& motion) {
  Vector16 force = linear_stiffness(element) * motion;
  const Corners4 of_prestress = element.volume * element.prestress * element.gradients;
  for (int k = 0; k < 4; ++k) {
    force.segment<3>(4 * k) += of_prestress.col(k);
  }
  return force;
}

Mat3 solid_stress(const SolidElement& e, const SolidMotion& motion, bool linear) {
  const Mat3 gradient = motion.displacement * e.gradients.transpose();
  const double p = e.shear * motion.pressure.mean();
  if (linear) {
    const Mat3 strain = 0.5 * (gradient + gradient.transpose());
    const double volume = strain.trace();
    return 2 * e.shear * strain + ((e.bulk_of_displacement - 2 * e.shear / 3) * volume + p) * Mat3::Identity() +
           e.prestress;
  }
  Point at;
  if (!at_point(e, gradient, p, at, false)) {
    return Mat3::Zero();
  }
  const Mat3 f = Mat3::Identity() + gradient;
  const Mat3 piola = at.stress + p * at.volume_derivative;
  return piola * f.transpose() / f.determinant();
}

}  // namespace tunica
