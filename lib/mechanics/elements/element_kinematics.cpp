#include "tunica/mechanics/elements/detail/element_kinematics.hpp"

#include "tunica/mechanics/elements/detail/shell_element_reference.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

namespace tunica {
namespace {

/// Rotation vectors: logarithm() of each lane.
LaneVec3 rotation_vectors(const LaneMat3& rotation) {
  const LaneVec3 axis =
      0.5 * LaneVec3(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0), rotation(1, 0) - rotation(0, 1));
  const Lanes s2 = axis.squaredNorm();
  const Lanes twice_cosine = rotation.trace() - 1;
  if (all_of(s2 < small_square && twice_cosine > 1)) {
    // asin(s) / s to 1e-18.
    const Lanes high = 105.0 / 3456 + s2 * (945.0 / 42240 + s2 * (10395.0 / 599040 + s2 * (135135.0 / 9676800)));
    return (1 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336 + s2 * high)))) * axis;
  }
  std::array<Vec3, lane_count> vectors;
  for (std::size_t k = 0; k < lane_count; ++k) {
    vectors[k] = logarithm(Mat3(lane(rotation, k)));
  }
  LaneVec3 result;
  set_lanes(
      result, [&](std::size_t k) -> const auto& { return vectors[k]; });
  return result;
}

LaneMat3 current_from_centroid(const ElementLanes& element, const MotionLanes& motion) {
  const LaneVec3 mean = (motion.displacement.col(0) + motion.displacement.col(1) + motion.displacement.col(2)) / 3;
  return element.from_centroid + (motion.displacement.colwise() - mean);
}

/// What the curved patch adds to the chord strain. Fills the edges and slopes.
LaneVec3 curved_strain(const ElementLanes& element, const std::array<LaneMat3, 3>& relative, Kinematics& now) {
  LaneVec3 strain = LaneVec3::Zero();
  LaneVector6 change;
  for (int k = 0; k < 3; ++k) {
    EdgeNow& edge = now.edges[k];
    const LaneVec2 along = now.frame.plane.col(next_corner(k)) - now.frame.plane.col(k);
    edge.length = along.norm();
    edge.direction << along / edge.length, Lanes(0);
    LaneVec2 turn;
    for (int end = 0; end < 2; ++end) {
      const std::size_t e = end;
      const LaneMat3& carrier = relative[corner_at(k, end)];
      edge.normal[e] = carrier * element.edge_normals.col(k);
      edge.side[e] = carrier * element.edge_sides.col(k);
      change[2 * k + end] =
          element.bending_edges[k] * (element.rest_normals[2 * k + end] - edge.direction.dot(edge.normal[e]));
      turn[end] = element.rest_sides[2 * k + end] - edge.direction.dot(edge.side[e]);
    }
    strain += element.bow.col(k) * (turn[1] - turn[0]);
  }
  now.slopes = element.slopes + change;
  const LaneVector6 middle = 0.5 * (now.slopes + element.slopes);
  for (int i = 0; i < 3; ++i) {
    strain[i] += change.dot(element.bulging[i].lazyProduct(middle));
  }
  for (int k = 0; k < 3; ++k) {
    const LaneVec3 turned = 0.5 * (now.rotation(k) + now.rotation(next_corner(k)));
    const Lanes turn = element.edge_directions.col(k).dot(turned.head<2>());
    now.tilts[k] = element.tilts[k] + turn;
    now.bulges[k] = now.slopes[2 * k] - now.slopes[2 * k + 1];
    now.state[12 + k] = 0.5 * (change[2 * k] + change[2 * k + 1]);
    // As differences, so that the reference is free of strain to the last bit.
    strain += element.sideways.col(k) * ((change[2 * k] - change[2 * k + 1]) * element.tilts[k] + now.bulges[k] * turn);
  }
  return strain;
}

}  // namespace

// Never inlined: what is made of the reference must be what was made of it, to the last bit.
[[gnu::noinline]] LaneMask find_frame(const LaneMat3& from_centroid, const LaneMat23& gradients, Frame& frame) {
  const LaneVec3 first = from_centroid.col(1) - from_centroid.col(0);
  const LaneVec3 second = from_centroid.col(2) - from_centroid.col(0);
  const LaneVec3 normal = first.cross(second);
  frame.twice_area = normal.norm();
  const Lanes length = first.norm();
  const LaneVec3 n = normal / frame.twice_area;
  const LaneVec3 e1 = first / length;
  const LaneVec3 e2 = n.cross(e1);
  LaneMat23 edge_axes;
  edge_axes.row(0) = e1.transpose();
  edge_axes.row(1) = e2.transpose();
  const LaneMat23 local = edge_axes * from_centroid;
  const LaneMat2 gradient = local * gradients.transpose();
  const Lanes a = gradient(0, 0) + gradient(1, 1);
  const Lanes b = gradient(1, 0) - gradient(0, 1);
  frame.trace = sqrt(a * a + b * b);
  const Lanes cosine = a / frame.trace;
  const Lanes sine = b / frame.trace;
  frame.axes.row(0) = (cosine * e1 + sine * e2).transpose();
  frame.axes.row(1) = (cosine * e2 - sine * e1).transpose();
  frame.axes.row(2) = n.transpose();
  frame.plane.row(0) = cosine * local.row(0) + sine * local.row(1);
  frame.plane.row(1) = cosine * local.row(1) - sine * local.row(0);
  return frame.twice_area > 1e-12 * length * length && frame.trace > 0;
}

LaneMask find_kinematics(const ElementLanes& element, const MotionLanes& motion, Kinematics& now) {
  const LaneMask valid = find_frame(current_from_centroid(element, motion), element.gradients, now.frame);
  std::array<LaneMat3, 3> relative;
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    relative[s] = now.frame.axes * motion.rotation[s] * element.axes.transpose();
    now.state.segment<3>(3 + 3 * k) = rotation_vectors(relative[s]);
  }
  const LaneMat23 stretch = now.frame.plane - element.plane;
  const LaneMat2 chord = stretch * element.gradients.transpose();
  LaneVec3 strain(chord(0, 0), chord(1, 1), chord(0, 1) + chord(1, 0));
  now.state.tail<3>().setZero();
  if (element.curved) {
    strain += curved_strain(element, relative, now);
  } else {
    for (int k = 0; k < 3; ++k) {
      strain += element.bow.col(k) * (now.rotation(next_corner(k)).z() - now.rotation(k).z());
    }
  }
  now.state.head<3>() = strain;
  return valid;
}

MotionLanes no_motion() {
  return {LaneMat3::Zero(), {LaneMat3::Identity(), LaneMat3::Identity(), LaneMat3::Identity()}};
}

}  // namespace tunica
