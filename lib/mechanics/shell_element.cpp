#include "mechanics/shell_element.hpp"

#include "mechanics/rotation.hpp"
#include "mechanics/shell_element_reference.hpp"

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

/// An edge in the frame, and what its ends carry.
struct EdgeNow {
  double length = 0;
  Vec3 direction;
  std::array<Vec3, 2> normal;  ///< R m
  std::array<Vec3, 2> side;    ///< R c
};

/// Everything that follows from the motion, in the frame's axes.
struct Kinematics {
  Frame frame;
  std::array<EdgeNow, 3> edges;
  Vector6 slopes;
  Vec3 bulges;  ///< of the edges: slope at the start less that at the end
  Vec3 tilts;
  ElementState state;

  [[nodiscard]] Vec3 rotation(int corner) const { return state.segment<3>(3 + 3 * corner); }
};

/// What the curved patch adds to the chord strain. Fills the edges and slopes.
Vec3 curved_strain(const ShellElement& element, const std::array<Mat3, 3>& relative, Kinematics& now) {
  Vec3 strain = Vec3::Zero();
  Vector6 change;
  for (int k = 0; k < 3; ++k) {
    EdgeNow& edge = now.edges[static_cast<std::size_t>(k)];
    const Vec2 along = now.frame.plane.col(next_corner(k)) - now.frame.plane.col(k);
    edge.length = along.norm();
    edge.direction << along / edge.length, 0;
    Vec2 turn;
    for (int end = 0; end < 2; ++end) {
      const auto e = static_cast<std::size_t>(end);
      const Mat3& carrier = relative[static_cast<std::size_t>(corner_at(k, end))];
      edge.normal[e] = carrier * element.edge_normals.col(k);
      edge.side[e] = carrier * element.edge_sides.col(k);
      change[2 * k + end] = element.rest_normals[2 * k + end] - edge.direction.dot(edge.normal[e]);
      turn[end] = element.rest_sides[2 * k + end] - edge.direction.dot(edge.side[e]);
    }
    strain += element.bow.col(k) * (turn[1] - turn[0]);
  }
  now.slopes = element.slopes + change;
  const Vector6 middle = 0.5 * (now.slopes + element.slopes);
  for (int i = 0; i < 3; ++i) {
    strain[i] += change.dot(element.bulging[static_cast<std::size_t>(i)].lazyProduct(middle));
  }
  for (int k = 0; k < 3; ++k) {
    const Vec3 turned = 0.5 * (now.rotation(k) + now.rotation(next_corner(k)));
    const double turn = element.edge_directions.col(k).dot(turned.head<2>());
    now.tilts[k] = element.tilts[k] + turn;
    now.bulges[k] = now.slopes[2 * k] - now.slopes[2 * k + 1];
    now.state[12 + k] = 0.5 * (change[2 * k] + change[2 * k + 1]);
    // As differences, so that the reference is free of strain to the last bit.
    strain += element.sideways.col(k) * ((change[2 * k] - change[2 * k + 1]) * element.tilts[k] + now.bulges[k] * turn);
  }
  return strain;
}

bool find_kinematics(const ShellElement& element, const CornerMotion& motion, Kinematics& now) {
  if (!find_frame(current_from_centroid(element, motion), element.gradients, now.frame)) {
    return false;
  }
  std::array<Mat3, 3> relative;
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    relative[s] = now.frame.axes * motion.rotation[s] * element.axes.transpose();
    now.state.segment<3>(3 + 3 * k) = logarithm(relative[s]);
  }
  const Mat23 stretch = now.frame.plane - element.plane;
  const Eigen::Matrix2d chord = stretch * element.gradients.transpose();
  Vec3 strain(chord(0, 0), chord(1, 1), chord(0, 1) + chord(1, 0));
  now.state.tail<3>().setZero();
  if (element.curved) {
    strain += curved_strain(element, relative, now);
  } else {
    for (int k = 0; k < 3; ++k) {
      strain += element.bow.col(k) * (now.rotation(next_corner(k)).z() - now.rotation(k).z());
    }
  }
  now.state.head<3>() = strain;
  return true;
}

const CornerMotion still{Mat3::Zero(), {Mat3::Identity(), Mat3::Identity(), Mat3::Identity()}};

// Rows are contiguous, so that products with a transpose are sums of columns.
using Matrix3x18 = Eigen::Matrix<double, 3, 18, Eigen::RowMajor>;
using Matrix6x18 = Eigen::Matrix<double, 6, 18, Eigen::RowMajor>;
using Matrix3x6 = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;

/// Derivatives with respect to displacements and spins, in the frame's axes. All but the strain: of a curved element
/// only.
struct Derivatives {
  Matrix3x18 strain;
  Matrix6x18 slopes;
  Matrix3x18 bulges;
  Matrix3x18 tilts;
};

void add_curved_derivatives(const ShellElement& element, const Kinematics& now, const std::array<Mat3, 3>& h,
                            const std::array<Mat3, 3>& g, Derivatives& d) {
  d.slopes.setZero();
  d.tilts.setZero();
  for (int k = 0; k < 3; ++k) {
    const EdgeNow& edge = now.edges[static_cast<std::size_t>(k)];
    const auto across = [&](const Vec3& carried) {
      return Vec3((carried - edge.direction * edge.direction.dot(carried)) / edge.length);
    };
    for (int end = 0; end < 2; ++end) {
      const Vec3& normal = edge.normal[static_cast<std::size_t>(end)];
      auto row = d.slopes.row(2 * k + end);
      row.segment<3>(6 * next_corner(k)) = -across(normal).transpose();
      row.segment<3>(6 * k) = across(normal).transpose();
      row.segment<3>(6 * corner_at(k, end) + 3) = -normal.cross(edge.direction).transpose();
    }
    const Eigen::RowVector3d difference = across(edge.side[1] - edge.side[0]).transpose();
    d.strain.block<3, 3>(0, 6 * next_corner(k)) -= element.bow.col(k) * difference;
    d.strain.block<3, 3>(0, 6 * k) += element.bow.col(k) * difference;
    d.strain.block<3, 3>(0, 6 * next_corner(k) + 3) -=
        element.bow.col(k) * edge.side[1].cross(edge.direction).transpose();
    d.strain.block<3, 3>(0, 6 * k + 3) += element.bow.col(k) * edge.side[0].cross(edge.direction).transpose();
  }
  Matrix3x6 of_slopes;
  for (int i = 0; i < 3; ++i) {
    of_slopes.row(i) = element.bulging[static_cast<std::size_t>(i)].lazyProduct(now.slopes).transpose();
  }
  d.strain += of_slopes.lazyProduct(d.slopes);
  for (int k = 0; k < 3; ++k) {
    d.bulges.row(k) = d.slopes.row(2 * k) - d.slopes.row(2 * k + 1);
    // Bending rotations follow the spins of the corners less that of the frame.
    Eigen::RowVector3d of_frame = Eigen::RowVector3d::Zero();
    for (const int corner : {k, next_corner(k)}) {
      const Eigen::RowVector3d of_spin =
          0.5 * element.edge_directions.col(k).transpose() * h[static_cast<std::size_t>(corner)].topRows<2>();
      d.tilts.block<1, 3>(k, 6 * corner + 3) = of_spin;
      of_frame += of_spin;
    }
    for (int j = 0; j < 3; ++j) {
      d.tilts.block<1, 3>(k, 6 * j) -= of_frame * g[static_cast<std::size_t>(j)];
    }
  }
  const Mat3 of_bulges = element.sideways * now.tilts.asDiagonal();
  const Mat3 of_tilts = element.sideways * now.bulges.asDiagonal();
  d.strain += of_bulges.lazyProduct(d.bulges) + of_tilts.lazyProduct(d.tilts);
}

/// H: spin to rate of the rotation vector; G_k: spin of the frame from the displacement of corner k.
void find_derivatives(const ShellElement& element, const Kinematics& now, const std::array<Mat3, 3>& h,
                      const std::array<Mat3, 3>& g, Derivatives& d) {
  d.strain.setZero();
  // Chord strain: the corners' motion less the turn of the frame about its normal.
  Vec3 of_turn = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vec2 gk = element.gradients.col(k);
    d.strain.block<3, 2>(0, 6 * k) << gk.x(), 0, 0, gk.y(), gk.y(), gk.x();
    of_turn += d.strain.block<3, 2>(0, 6 * k) * Vec2(now.frame.plane(1, k), -now.frame.plane(0, k));
  }
  for (int k = 0; k < 3; ++k) {
    d.strain.block<3, 3>(0, 6 * k) += of_turn * g[static_cast<std::size_t>(k)].row(2);
  }
  if (element.curved) {
    add_curved_derivatives(element, now, h, g, d);
    return;
  }
  for (int k = 0; k < 3; ++k) {
    const Vec3 of_rotation = element.bow.col((k + 2) % 3) - element.bow.col(k);
    const Mat3 of_spin = of_rotation * h[static_cast<std::size_t>(k)].row(2);
    d.strain.block<3, 3>(0, 6 * k + 3) += of_spin;
    for (int j = 0; j < 3; ++j) {
      d.strain.block<3, 3>(0, 6 * j) -= of_spin * g[static_cast<std::size_t>(j)];
    }
  }
}

/// Spin of the frame: sum of G_k times the displacement of corner k.
std::array<Mat3, 3> frame_spin(const ShellElement& element, const Frame& frame, Mat23& current_gradients) {
  std::array<Mat3, 3> g;
  for (int k = 0; k < 3; ++k) {
    const Vec2 opposite = frame.plane.col((k + 1) % 3) - frame.plane.col((k + 2) % 3);
    current_gradients.col(k) = Vec2(opposite.y(), -opposite.x()) / frame.twice_area;
    g[static_cast<std::size_t>(k)] << 0, 0, current_gradients(1, k), 0, 0, -current_gradients(0, k),
        -element.gradients(1, k) / frame.trace, element.gradients(0, k) / frame.trace, 0;
  }
  return g;
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

/// t += a'b where the sum is symmetric: half of it is computed.
template <typename Rows>
void add_symmetric_product(const Rows& a, const Rows& b, Matrix18& t) {
  for (int j = 0; j < 18; j += 6) {
    for (int i = 0; i <= j; i += 6) {
      const Matrix6 block = a.template middleCols<6>(i).transpose().lazyProduct(b.template middleCols<6>(j));
      t.block<6, 6>(i, j) += block;
      if (i != j) {
        t.block<6, 6>(j, i) += block.transpose();
      }
    }
  }
}

/// The part with the stiffness of the element itself.
void add_material(const ShellElement& element, double factor, const std::array<Mat3, 3>& h,
                  const std::array<Mat3, 3>& g, const Derivatives& d, Matrix18& t) {
  const Matrix3x18 stress = (factor * element.membrane).lazyProduct(d.strain);
  add_symmetric_product(d.strain, stress, t);
  if (!element.skewing.isZero(0)) {
    Matrix3x18 skewness;
    for (int k = 0; k < 3; ++k) {
      skewness.row(k) = 0.5 * (d.slopes.row(2 * k) + d.slopes.row(2 * k + 1));
    }
    const Matrix3x18 on_skewness = (factor * element.skewing).asDiagonal() * skewness;
    add_symmetric_product(skewness, on_skewness, t);
  }
  // Rotation vectors: H_i'K_ij H_j between spins, where spins of the frame count against those of the corners.
  Mat3 all = Mat3::Zero();
  std::array<Mat3, 3> rows{Mat3::Zero(), Mat3::Zero(), Mat3::Zero()};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const Mat3 block = factor * h[static_cast<std::size_t>(i)].transpose() *
                         element.rotational.block<3, 3>(3 * i, 3 * j) * h[static_cast<std::size_t>(j)];
      t.block<3, 3>(6 * i + 3, 6 * j + 3) += block;
      rows[static_cast<std::size_t>(i)] += block;
    }
    all += rows[static_cast<std::size_t>(i)];
  }
  for (int j = 0; j < 3; ++j) {
    const Mat3& gj = g[static_cast<std::size_t>(j)];
    for (int i = 0; i < 3; ++i) {
      const Mat3 block = rows[static_cast<std::size_t>(i)] * gj;
      t.block<3, 3>(6 * i + 3, 6 * j) -= block;
      t.block<3, 3>(6 * j, 6 * i + 3) -= block.transpose();
      t.block<3, 3>(6 * i, 6 * j) += g[static_cast<std::size_t>(i)].transpose() * all * gj;
    }
  }
}

/// What chord strain and rotation vectors add to the geometric stiffness: n are the corners' forces, m their moments.
void add_corotational_stiffness(const ShellElement& element, const Kinematics& now, const std::array<Vec3, 3>& n,
                                const std::array<Vec3, 3>& local_moment, const std::array<Mat3, 3>& h,
                                const std::array<Mat3, 3>& g, const Mat23& current_gradients, const Vec3& total,
                                const std::array<Vec3, 3>& force, const std::array<Vec3, 3>& moment, Matrix18& t) {
  const Frame& frame = now.frame;
  // The derivative of H, where spins of the frame count against those of the corners.
  Mat3 all = Mat3::Zero();
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    const Mat3 change = spin_to_rate_derivative(now.rotation(k), local_moment[s]) * h[s];
    all += change;
    t.block<3, 3>(6 * k + 3, 6 * k + 3) += change;
    for (int j = 0; j < 3; ++j) {
      t.block<3, 3>(6 * k + 3, 6 * j) -= change * g[static_cast<std::size_t>(j)];
      t.block<3, 3>(6 * j, 6 * k + 3) -= g[static_cast<std::size_t>(j)].transpose() * change;
    }
  }
  // Of the levers q, of G, and of the frame in which the force is expressed.
  Mat3 levers = all;
  for (int k = 0; k < 3; ++k) {
    levers += skew(n[static_cast<std::size_t>(k)]) * skew(Vec3(frame.plane(0, k), frame.plane(1, k), 0));
  }
  const Vec2 swapped(-total.y(), total.x());
  const double in_plane = total.z() / (frame.trace * frame.trace);
  for (int i = 0; i < 3; ++i) {
    const auto si = static_cast<std::size_t>(i);
    const Vec2 gi = current_gradients.col(i);
    const Mat3 spun_force = skew(force[si]);
    const Mat3 spun_moment = skew(moment[si]);
    for (int j = 0; j < 3; ++j) {
      const auto sj = static_cast<std::size_t>(j);
      auto block = t.block<3, 3>(6 * i, 6 * j);
      block += g[si].transpose() * (skew(n[sj]) + levers * g[sj]) - spun_force * g[sj];
      block.block<1, 2>(2, 0) += swapped.dot(current_gradients.col(j)) * gi.transpose();
      block.row(2) += (gi.x() * swapped.y() - gi.y() * swapped.x()) * g[sj].row(2);
      block.block<2, 2>(0, 0) +=
          in_plane * Vec2(-element.gradients(1, i), element.gradients(0, i)) * element.gradients.col(j).transpose();
      t.block<3, 3>(6 * i + 3, 6 * j) -= spun_moment * g[sj];
    }
  }
}

/// Second derivative of e.(R v) for a vector v carried by the end of an edge.
void add_edge_stiffness(const EdgeNow& edge, int start, int carrier, const Vec3& carried, Matrix18& t) {
  const Vec3& e = edge.direction;
  const int stop = next_corner(start);
  const double value = e.dot(carried);
  const Vec3 p = (carried - e * value) / edge.length;
  const Mat3 across = (Mat3::Identity() - e * e.transpose()) / edge.length;
  const Mat3 of_length = (value * across + e * p.transpose() + p * e.transpose()) / edge.length;
  t.block<3, 3>(6 * stop, 6 * stop) -= of_length;
  t.block<3, 3>(6 * start, 6 * start) -= of_length;
  t.block<3, 3>(6 * stop, 6 * start) += of_length;
  t.block<3, 3>(6 * start, 6 * stop) += of_length;
  const Mat3 turned = skew(carried) * across;  // its transpose is -across skew(carried)
  const int spin = 6 * carrier + 3;
  t.block<3, 3>(6 * stop, spin) += turned.transpose();
  t.block<3, 3>(6 * start, spin) -= turned.transpose();
  t.block<3, 3>(spin, 6 * stop) += turned;
  t.block<3, 3>(spin, 6 * start) -= turned;
  t.block<3, 3>(spin, spin) += carried * e.transpose() - value * Mat3::Identity();
}

}  // namespace

ShellElement make_shell_element(const std::array<Vec3, 3>& corners, const ShellSurface& surface,
                                const Material& material, double thickness, Membrane membrane, Bending bending,
                                double higher_order_scale) {
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
  double spread = 1;  // area of the patch to that of the facet
  element.curved = surface.curved;
  if (surface.curved) {
    find_edges(surface, element);
    find_bulging(element);
    for (int i = 0; i < 2; ++i) {
      spread += 0.5 * element.slopes.dot(element.bulging[static_cast<std::size_t>(i)] * element.slopes);
      for (int k = 0; k < 3; ++k) {
        spread += element.sideways(i, k) * (element.slopes[2 * k] - element.slopes[2 * k + 1]) * element.tilts[k];
      }
    }
  }

  const Mat3 elasticity = plane_stress(material);
  const MembraneStiffness in_plane = membrane == Membrane::cst
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
    case Bending::dkt_comas:
      out_of_plane = bending_dkt_comas(triangle, elasticity, thickness);
      break;
  }
  element.membrane = spread * in_plane.basic;
  element.bow = in_plane.bow;
  find_rotational(surface, out_of_plane, in_plane.higher_order, element);

  element.rotational *= spread;
  if (surface.curved) {
    find_short_waves(surface, material.young * thickness, element);
  }
  element.area *= spread;
  if (surface.curved) {
    element.rest_normals.setZero();
    element.rest_sides.setZero();
    Kinematics rest;
    find_kinematics(element, still, rest);
    for (int i = 0; i < 6; ++i) {
      const EdgeNow& edge = rest.edges[static_cast<std::size_t>(i / 2)];
      element.rest_normals[i] = edge.direction.dot(edge.normal[static_cast<std::size_t>(i % 2)]);
      element.rest_sides[i] = edge.direction.dot(edge.side[static_cast<std::size_t>(i % 2)]);
    }
  }
  return element;
}

bool deformation(const ShellElement& element, const CornerMotion& motion, ElementState& result) {
  Kinematics now;
  if (!find_kinematics(element, motion, now)) {
    return false;
  }
  result = now.state;
  return true;
}

ElementState element_force(const ShellElement& element, const ElementState& deformation) {
  ElementState force;
  force.head<3>().noalias() = element.membrane * deformation.head<3>();
  force.segment<9>(3).noalias() = element.rotational * deformation.segment<9>(3);
  force.tail<3>() = element.skewing.cwiseProduct(deformation.tail<3>());
  return force;
}

double strain_energy(const ShellElement& element, const ElementState& deformation) {
  return 0.5 * deformation.dot(element_force(element, deformation));
}

namespace {

/// What the derivatives need at the reference.
struct Reference {
  Derivatives derivatives;
  std::array<Mat3, 3> h{Mat3::Identity(), Mat3::Identity(), Mat3::Identity()};
  std::array<Mat3, 3> g;
};

Reference find_reference(const ShellElement& element) {
  Kinematics now;
  find_kinematics(element, still, now);
  Mat23 gradients;
  Reference reference;
  reference.g = frame_spin(element, now.frame, gradients);
  find_derivatives(element, now, reference.h, reference.g, reference.derivatives);
  return reference;
}

}  // namespace

ElementState linear_deformation(const ShellElement& element, const Vector18& motion) {
  const Reference reference = find_reference(element);
  Vector18 local;
  for (int k = 0; k < 6; ++k) {
    local.segment<3>(3 * k) = element.axes * motion.segment<3>(3 * k);
  }
  Vec3 spin = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    spin += reference.g[static_cast<std::size_t>(k)] * local.segment<3>(6 * k);
  }
  ElementState state = ElementState::Zero();
  state.head<3>() = reference.derivatives.strain * local;
  if (element.curved) {
    const Vector6 slopes = reference.derivatives.slopes * local;
    for (int k = 0; k < 3; ++k) {
      state[12 + k] = 0.5 * (slopes[2 * k] + slopes[2 * k + 1]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    state.segment<3>(3 + 3 * k) = local.segment<3>(6 * k + 3) - spin;
  }
  return state;
}

Matrix18 linear_stiffness(const ShellElement& element) {
  const Reference reference = find_reference(element);
  Matrix18 stiffness = Matrix18::Zero();
  add_material(element, 1, reference.h, reference.g, reference.derivatives, stiffness);
  rotate_to_world(element.axes, stiffness);
  return stiffness;
}

bool corotational_response(const ShellElement& element, const CornerMotion& motion, const Viscous& viscous,
                           ElementResponse& response, Matrix18* tangent) {
  Kinematics now;
  if (!find_kinematics(element, motion, now)) {
    return false;
  }
  response.deformation = now.state;
  ElementState stress = element_force(element, now.state);
  response.energy = 0.5 * now.state.dot(stress);
  if (viscous.factor > 0) {
    stress += viscous.factor * element_force(element, now.state - *viscous.previous);
  }
  // What the membrane force does on slopes and rotations.
  Vector6 on_slopes = Vector6::Zero();
  Matrix6 slope_stiffness = Matrix6::Zero();
  const Vec3 on_bows = element.bow.transpose() * stress.head<3>();
  const Vec3 on_sides = element.curved ? Vec3(element.sideways.transpose() * stress.head<3>()) : Vec3(Vec3::Zero());
  if (element.curved) {
    for (int i = 0; i < 3; ++i) {
      slope_stiffness += stress[i] * element.bulging[static_cast<std::size_t>(i)];
    }
    on_slopes = slope_stiffness.lazyProduct(now.slopes);
    for (int k = 0; k < 3; ++k) {
      on_slopes[2 * k] += on_sides[k] * now.tilts[k] + 0.5 * stress[12 + k];
      on_slopes[2 * k + 1] += -on_sides[k] * now.tilts[k] + 0.5 * stress[12 + k];
      const Vec2 on_bending = 0.5 * on_sides[k] * now.bulges[k] * element.edge_directions.col(k);
      stress.segment<2>(3 + 3 * k) += on_bending;
      stress.segment<2>(3 + 3 * next_corner(k)) += on_bending;
    }
  } else {
    for (int k = 0; k < 3; ++k) {
      stress[5 + 3 * k] += on_bows[(k + 2) % 3] - on_bows[k];
    }
  }

  Mat23 current_gradients;
  const std::array<Mat3, 3> g = frame_spin(element, now.frame, current_gradients);
  // Chord strain and rotation vectors: forces n and moments in the frame, and what keeps them in balance.
  std::array<Vec3, 3> n, local_moment, moment, force;
  std::array<Mat3, 3> h;
  Vec3 total = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    const Vec2 gk = element.gradients.col(k);
    n[s] << stress[0] * gk.x() + stress[2] * gk.y(), stress[1] * gk.y() + stress[2] * gk.x(), 0;
    local_moment[s] = stress.segment<3>(3 + 3 * k);
    h[s] = spin_to_rate(now.rotation(k));
    moment[s] = h[s].transpose() * local_moment[s];
    total += Vec3(0, 0, now.frame.plane(0, k) * n[s].y() - now.frame.plane(1, k) * n[s].x()) + moment[s];
  }
  Vector18 result;
  for (int k = 0; k < 3; ++k) {
    const auto s = static_cast<std::size_t>(k);
    force[s] = n[s] - g[s].transpose() * total;
    result.segment<3>(6 * k) = force[s];
    result.segment<3>(6 * k + 3) = moment[s];
  }
  // Slopes and bows: one carried vector per end of an edge collects what works on both.
  std::array<std::array<Vec3, 2>, 3> carried;
  for (int k = 0; k < 3 && element.curved; ++k) {
    const EdgeNow& edge = now.edges[static_cast<std::size_t>(k)];
    for (int end = 0; end < 2; ++end) {
      const auto e = static_cast<std::size_t>(end);
      Vec3& v = carried[static_cast<std::size_t>(k)][e];
      v = -on_slopes[2 * k + end] * edge.normal[e] - (end == 0 ? -on_bows[k] : on_bows[k]) * edge.side[e];
      const Vec3 p = (v - edge.direction * edge.direction.dot(v)) / edge.length;
      result.segment<3>(6 * next_corner(k)) += p;
      result.segment<3>(6 * k) -= p;
      result.segment<3>(6 * corner_at(k, end) + 3) += v.cross(edge.direction);
    }
  }
  for (int k = 0; k < 6; ++k) {
    response.force.segment<3>(3 * k) = now.frame.axes.transpose() * result.segment<3>(3 * k);
  }
  if (tangent == nullptr) {
    return true;
  }

  Derivatives d;
  find_derivatives(element, now, h, g, d);
  Matrix18& t = *tangent;
  t.setZero();
  add_material(element, 1 + viscous.factor, h, g, d, t);
  add_corotational_stiffness(element, now, n, local_moment, h, g, current_gradients, total, force, moment, t);
  if (element.curved) {
    const Matrix6x18 on_slope_changes = slope_stiffness.lazyProduct(d.slopes);
    add_symmetric_product(d.slopes, on_slope_changes, t);
    const Matrix3x18 on_bulge_changes = on_sides.asDiagonal() * d.tilts;
    const Matrix18 coupling = d.bulges.transpose().lazyProduct(on_bulge_changes);
    t += coupling + coupling.transpose();
    for (int k = 0; k < 3; ++k) {
      for (int end = 0; end < 2; ++end) {
        add_edge_stiffness(now.edges[static_cast<std::size_t>(k)], k, corner_at(k, end),
                           carried[static_cast<std::size_t>(k)][static_cast<std::size_t>(end)], t);
      }
    }
  }
  rotate_to_world(now.frame.axes, t);
  return true;
}

}  // namespace tunica
