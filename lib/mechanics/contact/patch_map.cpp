#include "tunica/mechanics/contact/patch_map.hpp"

#include "tunica/mechanics/elements/rotation.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

/// A number with its first and second derivatives by three variables.
struct Jet {
  double v = 0;
  Vec3 g = Vec3::Zero();
  Mat3 h = Mat3::Zero();

  static Jet variable(double value, int index) { return {value, Vec3(Vec3::Unit(index)), Mat3::Zero()}; }
  static Jet constant(double value) { return {value, Vec3::Zero(), Mat3::Zero()}; }
};

Jet operator+(const Jet& a, const Jet& b) { return {a.v + b.v, a.g + b.g, a.h + b.h}; }
Jet operator-(const Jet& a, const Jet& b) { return {a.v - b.v, a.g - b.g, a.h - b.h}; }
Jet operator*(double a, const Jet& b) { return {a * b.v, a * b.g, a * b.h}; }
Jet operator*(const Jet& a, const Jet& b) {
  return {a.v * b.v, a.v * b.g + b.v * a.g, a.v * b.h + b.v * a.h + a.g * b.g.transpose() + b.g * a.g.transpose()};
}
Jet apply(const Jet& a, double f, double df, double ddf) {
  return {f, df * a.g, df * a.h + ddf * a.g * a.g.transpose()};
}
Jet inverse(const Jet& a) {
  const double r = 1 / a.v;
  return apply(a, r, -r * r, 2 * r * r * r);
}
Jet root(const Jet& a) {
  const double r = std::sqrt(a.v);
  return apply(a, r, 0.5 / r, -0.25 / (r * a.v));
}

int next_of(int corner) { return (corner + 1) % 3; }

}  // namespace

PatchWeights patch_weights(const SurfaceFace& face, const Vec2& b) {
  PatchWeights weights = PatchWeights::Zero();
  if (!face.curved) {
    weights.head<3>() << 1 - b[0] - b[1], b[0], b[1];
    return weights;
  }
  const auto basis = bernstein(b);
  for (int k = 0; k < 9; ++k) {
    weights[k] = basis[k] + face.centre[k] * basis[9];
  }
  return weights;
}

std::array<PatchWeights, 2> patch_weight_derivatives(const SurfaceFace& face, const Vec2& b) {
  std::array<PatchWeights, 2> result{PatchWeights::Zero(), PatchWeights::Zero()};
  if (!face.curved) {
    result[0].head<3>() << -1, 1, 0;
    result[1].head<3>() << -1, 0, 1;
    return result;
  }
  const double l1 = 1 - b[0] - b[1], l2 = b[0], l3 = b[1];
  // By l1, l2, l3 of the ten Bernstein polynomials; along b2 that of l2 less that of l1, along b3 that of l3 less l1.
  const double d[10][3] = {{3 * l1 * l1, 0, 0},           {0, 3 * l2 * l2, 0},
                           {0, 0, 3 * l3 * l3},           {6 * l1 * l2, 3 * l1 * l1, 0},
                           {3 * l2 * l2, 6 * l1 * l2, 0}, {0, 6 * l2 * l3, 3 * l2 * l2},
                           {0, 3 * l3 * l3, 6 * l2 * l3}, {3 * l3 * l3, 0, 6 * l3 * l1},
                           {6 * l3 * l1, 0, 3 * l1 * l1}, {6 * l2 * l3, 6 * l1 * l3, 6 * l1 * l2}};
  for (int along = 0; along < 2; ++along) {
    const double of_centre = d[9][along + 1] - d[9][0];
    for (int k = 0; k < 9; ++k) {
      result[along][k] = d[k][along + 1] - d[k][0] + face.centre[k] * of_centre;
    }
  }
  return result;
}

PatchMap::PatchMap(const SurfaceFace& face, const std::vector<Vec3>& reference, const Configuration& configuration)
    : face_(face) {
  std::array<Vec3, 3> x;
  points_.setZero();
  for (int k = 0; k < 3; ++k) {
    x[k] = reference[face.nodes[k]] + configuration.displacement[face.nodes[k]];
    points_.col(k) = x[k];
  }
  for (int k = 0; face.curved && k < 6; ++k) {
    find_edge_point(k, x, configuration);
  }
}

/// watertight_edge_point(), as alpha e - beta mean - gamma difference.
void PatchMap::find_edge_point(int k, const std::array<Vec3, 3>& x, const Configuration& configuration) {
  EdgePoint& p = edges_[k];
  const int edge = k / 2;
  p.here = k % 2 == 0 ? edge : next_of(edge);
  p.there = k % 2 == 0 ? next_of(edge) : edge;
  p.edge = x[p.there] - x[p.here];
  const Eigen::Quaterniond& turn = configuration.rotation[face_.nodes[p.here]];
  const Vec3& own = face_.normals[p.here];
  const Vec3& other = face_.across[edge][k % 2];
  p.mean = turn * (own + other).normalized();
  p.difference = turn * (own - other);
  const Jet s = Jet::variable(p.mean.dot(p.edge), 0);
  const Jet a = Jet::variable(p.difference.dot(p.edge), 1);
  const Jet q = Jet::variable(p.edge.squaredNorm(), 2);
  const double squared = p.difference.squaredNorm();
  Jet share = Jet::constant(0);
  if (squared > 0) {
    share = Jet::constant(std::min(1.0, squared / crease_squared));
    const Jet across = (1 / squared) * (a * a) * inverse(q);
    const Jet fades = Jet::constant(2) - 4 * across;
    if (fades.v <= 0) {
      share = Jet::constant(0);
    } else if (fades.v < 1) {
      share = share * fades;
    }
  }
  Jet tangent = q - s * s;
  if (squared > 0) {
    tangent = tangent - (1 / squared) * ((2 * share - share * share) * (a * a));
  }
  const Jet ratio = tangent * inverse(q);
  const Jet cosine = ratio.v > 1e-18 ? root(ratio) : Jet::constant(1e-9);
  const Jet alpha = (2.0 / 3) * inverse((Jet::constant(1) + cosine) * cosine);
  const Jet beta = alpha * s;
  const Jet gamma = squared > 0 ? (1 / squared) * (alpha * share * a) : Jet::constant(0);
  p.alpha = alpha.v, p.beta = beta.v, p.gamma = gamma.v;
  p.d_alpha = alpha.g, p.d_beta = beta.g, p.d_gamma = gamma.g;
  p.dd_alpha = alpha.h, p.dd_beta = beta.h, p.dd_gamma = gamma.h;
  points_.col(3 + k) = x[p.here] + p.alpha * p.edge - p.beta * p.mean - p.gamma * p.difference;
}

void PatchMap::linearise() {
  for (int k = 0; face_.curved && k < 6; ++k) {
    edges_[k].linearise();
  }
  jacobian_.setZero();
  for (int k = 0; k < (face_.curved ? 9 : 3); ++k) {
    jacobian_.middleRows<3>(3 * k) = derivative(PatchWeights::Unit(k));
  }
}

void PatchMap::EdgePoint::linearise() {
  // Columns: s, a and q by the edge and by the spin.
  Eigen::Matrix<double, 6, 3> scalars;
  scalars << mean, difference, 2 * edge, mean.cross(edge), difference.cross(edge), Vec3::Zero();
  jacobian = edge * (scalars * d_alpha).transpose() - mean * (scalars * d_beta).transpose() -
             difference * (scalars * d_gamma).transpose();
  jacobian.leftCols<3>().diagonal().array() += alpha;
  jacobian.rightCols<3>() += beta * skew(mean) + gamma * skew(difference);
}

Matrix6 PatchMap::EdgePoint::curvature(const Vec3& f) const {
  const Vec3 &e = edge, &m = mean, &d = difference;
  Eigen::Matrix<double, 6, 3> scalars;
  scalars << m, d, 2 * e, m.cross(e), d.cross(e), Vec3::Zero();
  const double a = e.dot(f), b = -m.dot(f), c = -d.dot(f);
  const Vec3 psi = a * d_alpha + b * d_beta + c * d_gamma;
  Eigen::Matrix<double, 6, 3> changes = scalars * (a * dd_alpha + b * dd_beta + c * dd_gamma);  // of psi
  changes.topRows<3>() += f * d_alpha.transpose();
  changes.bottomRows<3>() -= m.cross(f) * d_beta.transpose() + d.cross(f) * d_gamma.transpose();
  Matrix6 h;
  h.topRows<3>() = f * (scalars * d_alpha).transpose() + m * changes.col(0).transpose() +
                   d * changes.col(1).transpose() + 2 * e * changes.col(2).transpose();
  h.topLeftCorner<3, 3>().diagonal().array() += 2 * psi[2];
  h.topRightCorner<3, 3>() -= psi[0] * skew(m) + psi[1] * skew(d);
  h.bottomRows<3>() = m.cross(e) * changes.col(0).transpose() + d.cross(e) * changes.col(1).transpose() -
                      m.cross(f) * (scalars * d_beta).transpose() - d.cross(f) * (scalars * d_gamma).transpose();
  h.bottomLeftCorner<3, 3>() += psi[0] * skew(m) + psi[1] * skew(d);
  const auto turned = [](const Vec3& carried, const Vec3& by) {  // (spin x carried) x by
    return Mat3(carried * by.transpose() - carried.dot(by) * Mat3::Identity());
  };
  h.bottomRightCorner<3, 3>() +=
      psi[0] * turned(m, e) + psi[1] * turned(d, e) - beta * turned(m, f) - gamma * turned(d, f);
  return h;
}

PatchMap::Points PatchMap::change(const Vector18& of_nodes) const {
  Points result = Points::Zero();
  for (int k = 0; k < 3; ++k) {
    result.col(k) = of_nodes.segment<3>(6 * k);
  }
  for (int k = 0; face_.curved && k < 6; ++k) {
    const EdgePoint& p = edges_[k];
    Vector6 z;
    z << of_nodes.segment<3>(6 * p.there) - of_nodes.segment<3>(6 * p.here), of_nodes.segment<3>(6 * p.here + 3);
    result.col(3 + k) = of_nodes.segment<3>(6 * p.here) + p.jacobian * z;
  }
  return result;
}

Vector18 PatchMap::to_nodes(const Points& forces) const {
  Vector18 result = Vector18::Zero();
  for (int k = 0; k < 3; ++k) {
    result.segment<3>(6 * k) = forces.col(k);
  }
  for (int k = 0; face_.curved && k < 6; ++k) {
    const EdgePoint& p = edges_[k];
    const Vector6 z = p.jacobian.transpose() * forces.col(3 + k);
    result.segment<3>(6 * p.there) += z.head<3>();
    result.segment<3>(6 * p.here) += forces.col(3 + k) - z.head<3>();
    result.segment<3>(6 * p.here + 3) += z.tail<3>();
  }
  return result;
}

Eigen::Matrix<double, 3, 18> PatchMap::derivative(const PatchWeights& weights) const {
  Eigen::Matrix<double, 3, 18> result = Eigen::Matrix<double, 3, 18>::Zero();
  for (int k = 0; k < 3; ++k) {
    result.block<3, 3>(0, 6 * k).diagonal().array() += weights[k];
  }
  for (int k = 0; face_.curved && k < 6; ++k) {
    const EdgePoint& p = edges_[k];
    const double w = weights[3 + k];
    result.block<3, 3>(0, 6 * p.here).diagonal().array() += w;
    result.block<3, 3>(0, 6 * p.there) += w * p.jacobian.leftCols<3>();
    result.block<3, 3>(0, 6 * p.here) -= w * p.jacobian.leftCols<3>();
    result.block<3, 3>(0, 6 * p.here + 3) += w * p.jacobian.rightCols<3>();
  }
  return result;
}

Matrix18 PatchMap::stiffness(const Matrix27& of_points, const Points& forces) const {
  Matrix18 result;
  if (face_.curved) {
    result = jacobian_.transpose() * (of_points * jacobian_);
  } else {
    const auto corners = jacobian_.topRows<9>();
    result = corners.transpose() * (of_points.topLeftCorner<9, 9>() * corners);
  }
  for (int k = 0; face_.curved && k < 6; ++k) {
    const EdgePoint& p = edges_[k];
    const Matrix6 h = p.curvature(forces.col(3 + k));
    // z = (x_there - x_here, spin_here)
    const std::array<int, 3> places{6 * p.there, 6 * p.here, 6 * p.here + 3};
    const std::array<double, 3> signs{1, -1, 1};
    const std::array<int, 3> parts{0, 0, 3};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        result.block<3, 3>(places[i], places[j]) += signs[i] * signs[j] * h.block<3, 3>(parts[i], parts[j]);
      }
    }
  }
  return result;
}

}  // namespace tunica
