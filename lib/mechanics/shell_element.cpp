#include "mechanics/shell_element.hpp"

#include "mechanics/rotation.hpp"

namespace tunica {
namespace {

/// The current frame: rows f1, f2, n.
struct Frame {
  Mat3 axes;
  Mat23 plane;       ///< columns: corners minus centroid, in the frame
  double trace = 0;  ///< of the in-plane stretch
  double twice_area = 0;
};

/// At zero displacement this repeats, operation by operation, what make_shell_element() stored.
bool find_frame(const Mat3& from_centroid, const Mat23& gradients, Frame& frame) {
  const Vec3 first = from_centroid.col(1) - from_centroid.col(0);
  const Vec3 second = from_centroid.col(2) - from_centroid.col(0);
  const Vec3 normal = first.cross(second);
  frame.twice_area = normal.norm();
  const double length = first.norm();
  if (!(frame.twice_area > 1e-12 * length * length)) {
    return false;
  }
  const Vec3 n = normal / frame.twice_area;
  const Vec3 e1 = first / length;
  const Vec3 e2 = n.cross(e1);
  Mat23 edge_axes;
  edge_axes.row(0) = e1.transpose();
  edge_axes.row(1) = e2.transpose();
  const Mat23 local = edge_axes * from_centroid;
  const Eigen::Matrix2d gradient = local * gradients.transpose();
  const double a = gradient(0, 0) + gradient(1, 1);
  const double b = gradient(1, 0) - gradient(0, 1);
  frame.trace = std::hypot(a, b);
  if (!(frame.trace > 0)) {
    return false;
  }
  const double cosine = a / frame.trace;
  const double sine = b / frame.trace;
  frame.axes.row(0) = (cosine * e1 + sine * e2).transpose();
  frame.axes.row(1) = (cosine * e2 - sine * e1).transpose();
  frame.axes.row(2) = n.transpose();
  frame.plane.row(0) = cosine * local.row(0) + sine * local.row(1);
  frame.plane.row(1) = cosine * local.row(1) - sine * local.row(0);
  return true;
}

Mat3 current_from_centroid(const ShellElement& element, const CornerMotion& motion) {
  const Vec3 mean = (motion.displacement.col(0) + motion.displacement.col(1) + motion.displacement.col(2)) / 3;
  return element.from_centroid + (motion.displacement.colwise() - mean);
}

Vector18 deformation_in(const ShellElement& element, const CornerMotion& motion, const Frame& frame) {
  Vector18 result;
  for (int k = 0; k < 3; ++k) {
    result.segment<2>(6 * k) = frame.plane.col(k) - element.plane.col(k);
    result[6 * k + 2] = 0;
    const Mat3 relative = frame.axes * motion.rotation[static_cast<std::size_t>(k)] * element.axes.transpose();
    result.segment<3>(6 * k + 3) = logarithm(relative);
  }
  return result;
}

constexpr std::array<int, 9> membrane_rows{0, 1, 5, 6, 7, 11, 12, 13, 17};
constexpr std::array<int, 9> bending_rows{2, 3, 4, 8, 9, 10, 14, 15, 16};

Vector9 gather(const Vector18& v, const std::array<int, 9>& rows) {
  Vector9 part;
  for (int i = 0; i < 9; ++i) {
    part[i] = v[rows[static_cast<std::size_t>(i)]];
  }
  return part;
}

void fill(const ShellElement& element, double factor, Matrix18& stiffness) {
  stiffness.setZero();
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 9; ++i) {
      const auto row = static_cast<std::size_t>(i);
      const auto column = static_cast<std::size_t>(j);
      stiffness(membrane_rows[row], membrane_rows[column]) = factor * element.membrane(i, j);
      stiffness(bending_rows[row], bending_rows[column]) = factor * element.bending(i, j);
    }
  }
}

void rotate_to_world(const Mat3& axes, Matrix18& matrix) {
  const Mat3 to_world = axes.transpose();
  for (int j = 0; j < 6; ++j) {
    const Eigen::Matrix<double, 18, 3> columns = matrix.middleCols<3>(3 * j) * axes;
    for (int i = 0; i < 6; ++i) {
      matrix.block<3, 3>(3 * i, 3 * j).noalias() = to_world * columns.middleRows<3>(3 * i);
    }
  }
}

}  // namespace

ShellElement make_shell_element(const std::array<Vec3, 3>& corners, const Material& material, double thickness,
                                Membrane membrane, Bending bending, double higher_order_scale) {
  ShellElement element;
  element.thickness = thickness;
  const Vec3 first = corners[1] - corners[0];
  const Vec3 second = corners[2] - corners[0];
  const Vec3 normal = first.cross(second);
  element.area = normal.norm() / 2;
  const Vec3 mean = (first + second) / 3;
  element.from_centroid.col(0) = -mean;
  element.from_centroid.col(1) = first - mean;
  element.from_centroid.col(2) = second - mean;
  const Vec3 e1 = first.normalized();
  const Vec3 e3 = normal.normalized();
  const PlaneTriangle triangle{first.norm(), e1.dot(second), e3.cross(e1).dot(second)};
  element.gradients = barycentric_gradients(triangle);
  Frame frame;
  find_frame(element.from_centroid, element.gradients, frame);
  element.axes = frame.axes;
  element.plane = frame.plane;

  const Mat3 elasticity = plane_stress(material);
  const PlaneStiffness in_plane = membrane == Membrane::cst
                                      ? membrane_cst(triangle, elasticity, thickness)
                                      : membrane_opt(triangle, elasticity, thickness, higher_order_scale);
  PlaneStiffness out_of_plane;
  switch (bending) {
    case Bending::comas:
      out_of_plane = bending_comas(triangle, elasticity, thickness);
      break;
    case Bending::comas_consistent:
      out_of_plane = bending_comas_consistent(triangle, elasticity, thickness);
      break;
    case Bending::dkt:
      out_of_plane = bending_dkt(triangle, elasticity, thickness);
      break;
  }
  element.membrane = in_plane.stiffness;
  element.membrane_strain = in_plane.mean_strain;
  element.bending = out_of_plane.stiffness;
  element.curvature = out_of_plane.mean_strain;
  return element;
}

bool deformation(const ShellElement& element, const CornerMotion& motion, Vector18& result) {
  Frame frame;
  if (!find_frame(current_from_centroid(element, motion), element.gradients, frame)) {
    return false;
  }
  result = deformation_in(element, motion, frame);
  return true;
}

Vector18 element_force(const ShellElement& element, const Vector18& deformation) {
  const Vector9 in_plane = element.membrane * gather(deformation, membrane_rows);
  const Vector9 out_of_plane = element.bending * gather(deformation, bending_rows);
  Vector18 force;
  for (int i = 0; i < 9; ++i) {
    force[membrane_rows[static_cast<std::size_t>(i)]] = in_plane[i];
    force[bending_rows[static_cast<std::size_t>(i)]] = out_of_plane[i];
  }
  return force;
}

double strain_energy(const ShellElement& element, const Vector18& deformation) {
  return 0.5 * deformation.dot(element_force(element, deformation));
}

Matrix18 linear_stiffness(const ShellElement& element) {
  Matrix18 stiffness;
  fill(element, 1, stiffness);
  rotate_to_world(element.axes, stiffness);
  return stiffness;
}

bool corotational_response(const ShellElement& element, const CornerMotion& motion, const Viscous& viscous,
                           ElementResponse& response, Matrix18* tangent) {
  Frame frame;
  if (!find_frame(current_from_centroid(element, motion), element.gradients, frame)) {
    return false;
  }
  response.deformation = deformation_in(element, motion, frame);
  Vector18 local = element_force(element, response.deformation);
  response.energy = 0.5 * response.deformation.dot(local);
  if (viscous.factor > 0) {
    local += viscous.factor * element_force(element, response.deformation - *viscous.previous);
  }

  // q: corners in the frame; n, m: forces and moments there; H: spin to rate of the rotation vector.
  // Spin of the frame: sum of G_k times the (frame) displacement of corner k.
  std::array<Vec3, 3> q, n, moment;
  std::array<Mat3, 3> h, g;
  Vec3 total = Vec3::Zero();
  Mat23 current_gradients;
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    const Vec2 opposite = frame.plane.col((k + 1) % 3) - frame.plane.col((k + 2) % 3);
    current_gradients.col(k) = Vec2(opposite.y(), -opposite.x()) / frame.twice_area;
    q[s] << frame.plane.col(k), 0;
    n[s] = local.segment<3>(6 * k);
    h[s] = spin_to_rate(response.deformation.segment<3>(6 * k + 3));
    moment[s] = h[s].transpose() * local.segment<3>(6 * k + 3);
    total += q[s].cross(n[s]) + moment[s];
    g[s] << 0, 0, current_gradients(1, k), 0, 0, -current_gradients(0, k), -element.gradients(1, k) / frame.trace,
        element.gradients(0, k) / frame.trace, 0;
  }
  Vector18 force;
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    force.segment<3>(6 * k) = n[s] - g[s].transpose() * total;
    force.segment<3>(6 * k + 3) = moment[s];
  }
  for (int k = 0; k < 6; ++k) {
    response.force.segment<3>(3 * k) = frame.axes.transpose() * force.segment<3>(3 * k);
  }
  if (tangent == nullptr) {
    return true;
  }

  // Material part and the derivative of H.
  Matrix18& t = *tangent;
  fill(element, 1 + viscous.factor, t);
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    const Eigen::Matrix<double, 18, 3> columns = t.middleCols<3>(6 * k + 3) * h[s];
    t.middleCols<3>(6 * k + 3) = columns;
  }
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    const Eigen::Matrix<double, 3, 18> rows = h[s].transpose() * t.middleRows<3>(6 * k + 3);
    t.middleRows<3>(6 * k + 3) = rows;
    t.block<3, 3>(6 * k + 3, 6 * k + 3) +=
        spin_to_rate_derivative(response.deformation.segment<3>(6 * k + 3), local.segment<3>(6 * k + 3)) * h[s];
  }
  // The projector: deformations are what is left when the motion of the frame is taken away.
  std::array<Mat3, 3> skew_q;
  Eigen::Matrix<double, 18, 3> y = Eigen::Matrix<double, 18, 3>::Zero();
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    skew_q[s] = skew(q[s]);
    y += t.middleCols<3>(6 * k + 3);
    y.noalias() -= t.middleCols<3>(6 * k) * skew_q[s];
  }
  for (int k = 0; k < 3; ++k) {
    t.middleCols<3>(6 * k).noalias() -= y * g[static_cast<std::size_t>(k)];
  }
  Eigen::Matrix<double, 3, 18> z = Eigen::Matrix<double, 3, 18>::Zero();
  for (int k = 0; k < 3; ++k) {
    z += t.middleRows<3>(6 * k + 3);
    z.noalias() += skew_q[static_cast<std::size_t>(k)] * t.middleRows<3>(6 * k);
  }
  for (int k = 0; k < 3; ++k) {
    t.middleRows<3>(6 * k).noalias() -= g[static_cast<std::size_t>(k)].transpose() * z;
  }
  // Change of the projector: of the levers q, of G, and of the frame in which the force is expressed.
  Mat3 levers = Mat3::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    levers += skew(n[k]) * skew_q[k];
  }
  const Vec2 swapped(-total.y(), total.x());
  const double in_plane = total.z() / (frame.trace * frame.trace);
  for (int i = 0; i < 3; ++i) {
    const auto si = static_cast<std::size_t>(i);
    const Vec2 gi = current_gradients.col(i);
    for (int j = 0; j < 3; ++j) {
      const auto sj = static_cast<std::size_t>(j);
      auto block = t.block<3, 3>(6 * i, 6 * j);
      block += g[si].transpose() * (skew(n[sj]) + levers * g[sj]);
      block.block<1, 2>(2, 0) += swapped.dot(current_gradients.col(j)) * gi.transpose();
      block.row(2) += (gi.x() * swapped.y() - gi.y() * swapped.x()) * g[sj].row(2);
      block.block<2, 2>(0, 0) +=
          in_plane * Vec2(-element.gradients(1, i), element.gradients(0, i)) * element.gradients.col(j).transpose();
    }
  }
  for (int i = 0; i < 6; ++i) {
    const Mat3 spun = skew(force.segment<3>(3 * i));
    for (int j = 0; j < 3; ++j) {
      t.block<3, 3>(3 * i, 6 * j) -= spun * g[static_cast<std::size_t>(j)];
    }
  }
  rotate_to_world(frame.axes, t);
  return true;
}

}  // namespace tunica
