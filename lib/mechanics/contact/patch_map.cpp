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

  Jet() = default;
  Jet(double value) : v(value) {}  // NOLINT(google-explicit-constructor): a constant
  Jet(double value, const Vec3& gradient, const Mat3& hessian) : v(value), g(gradient), h(hessian) {}

  static Jet variable(double value, int index) { return {value, Vec3(Vec3::Unit(index)), Mat3::Zero()}; }
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
double inverse(double a) { return 1 / a; }
Jet inverse(const Jet& a) {
  const double r = 1 / a.v;
  return apply(a, r, -r * r, 2 * r * r * r);
}
double root(double a) { return std::sqrt(a); }
Jet root(const Jet& a) {
  const double r = std::sqrt(a.v);
  return apply(a, r, 0.5 / r, -0.25 / (r * a.v));
}
double value_of(double a) { return a; }
double value_of(const Jet& a) { return a.v; }

/// watertight_edge_point() is the corner + alpha edge - beta mean - gamma difference: {alpha, beta, gamma}.
/// @param s, a  products of the edge with mean and difference of the normals; q  with itself
/// @param squared  length of the difference
template <typename Scalar>
std::array<Scalar, 3> edge_factors(const Scalar& s, const Scalar& a, const Scalar& q, double squared) {
  Scalar share = 0.0;
  if (squared > 0) {
    share = std::min(1.0, squared / crease_squared);
    const Scalar across = (1 / squared) * (a * a) * inverse(q);
    const Scalar fades = Scalar(2.0) - 4 * across;
    if (value_of(fades) <= 0) {
      share = 0.0;
    } else if (value_of(fades) < 1) {
      share = share * fades;
    }
  }
  Scalar tangent = q - s * s;
  if (squared > 0) {
    tangent = tangent - (1 / squared) * ((2 * share - share * share) * (a * a));
  }
  const Scalar ratio = tangent * inverse(q);
  const Scalar cosine = value_of(ratio) > 1e-18 ? root(ratio) : Scalar(1e-9);
  const Scalar alpha = (2.0 / 3) * inverse((Scalar(1.0) + cosine) * cosine);
  return {alpha, alpha * s, squared > 0 ? (1 / squared) * (alpha * share * a) : Scalar(0.0)};
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
    : face_(&face) {
  local_.setZero();
  const Vec3& origin = reference[face.nodes[0]];
  for (int k = 0; k < 3; ++k) {
    local_.col(k) = reference[face.nodes[k]] - origin + configuration.displacement[face.nodes[k]];
    turns_[k] = configuration.rotation[face.nodes[k]];
  }
  for (int k = 0; face.curved && k < 6; ++k) {
    const EdgePoint p = edge_point(k);
    const auto [alpha, beta, gamma] =
        edge_factors(p.mean.dot(p.edge), p.difference.dot(p.edge), p.edge.squaredNorm(), p.difference.squaredNorm());
    local_.col(3 + k) = local_.col(p.here) + alpha * p.edge - beta * p.mean - gamma * p.difference;
  }
  points_.setZero();
  const int count = face.curved ? 9 : 3;
  points_.leftCols(count) = local_.leftCols(count).colwise() + origin;
}

PatchMap::EdgePoint PatchMap::edge_point(int k) const {
  const int edge = k / 2;
  EdgePoint p;
  p.here = k % 2 == 0 ? edge : next_of(edge);
  p.there = k % 2 == 0 ? next_of(edge) : edge;
  p.edge = local_.col(p.there) - local_.col(p.here);
  const Vec3& own = face_->normals[p.here];
  const Vec3& other = face_->across[edge][k % 2];
  p.mean = turns_[p.here] * (own + other).normalized();
  p.difference = turns_[p.here] * (own - other);
  return p;
}

PatchMap::LinearEdge::LinearEdge(const EdgePoint& p) : EdgePoint(p) {
  const auto [a, b, c] = edge_factors(Jet::variable(mean.dot(edge), 0), Jet::variable(difference.dot(edge), 1),
                                      Jet::variable(edge.squaredNorm(), 2), difference.squaredNorm());
  alpha = a.v, beta = b.v, gamma = c.v;
  d_alpha = a.g, d_beta = b.g, d_gamma = c.g;
  dd_alpha = a.h, dd_beta = b.h, dd_gamma = c.h;
  // Columns: s, a and q by the edge and by the spin.
  Eigen::Matrix<double, 6, 3> scalars;
  scalars << mean, difference, 2 * edge, mean.cross(edge), difference.cross(edge), Vec3::Zero();
  jacobian = edge * (scalars * d_alpha).transpose() - mean * (scalars * d_beta).transpose() -
             difference * (scalars * d_gamma).transpose();
  jacobian.leftCols<3>().diagonal().array() += alpha;
  jacobian.rightCols<3>() += beta * skew(mean) + gamma * skew(difference);
}

void PatchMap::linearise() {
  if (linear_) {
    return;
  }
  linear_ = std::make_unique<Linear>();
  for (int k = 0; face_->curved && k < 6; ++k) {
    linear_->edges.emplace_back(edge_point(k));
  }
  linear_->jacobian.setZero();
  for (int k = 0; k < (face_->curved ? 9 : 3); ++k) {
    linear_->jacobian.middleRows<3>(3 * k) = derivative(PatchWeights::Unit(k));
  }
}

Matrix6 PatchMap::LinearEdge::curvature(const Vec3& f) const {
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
  for (int k = 0; face_->curved && k < 6; ++k) {
    const LinearEdge& p = linear_->edges[k];
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
  for (int k = 0; face_->curved && k < 6; ++k) {
    const LinearEdge& p = linear_->edges[k];
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
  for (int k = 0; face_->curved && k < 6; ++k) {
    const LinearEdge& p = linear_->edges[k];
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
  if (face_->curved) {
    result = jacobian().transpose() * (of_points * jacobian());
  } else {
    const auto corners = jacobian().topRows<9>();
    result = corners.transpose() * (of_points.topLeftCorner<9, 9>() * corners);
  }
  for (int k = 0; face_->curved && k < 6; ++k) {
    const LinearEdge& p = linear_->edges[k];
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
