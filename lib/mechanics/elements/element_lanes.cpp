#include "tunica/mechanics/elements/element_lanes.hpp"

#include "tunica/core/error.hpp"
#include "tunica/mechanics/elements/detail/element_kinematics.hpp"
#include "tunica/mechanics/elements/detail/shell_element_reference.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

namespace tunica {
namespace {

LaneState element_force(const ElementLanes& element, const LaneState& deformation) {
  LaneState force;
  force.head<3>() = element.membrane.lazyProduct(deformation.head<3>());
  force.segment<9>(3) = element.rotational.lazyProduct(deformation.segment<9>(3));
  force.tail<3>() = element.skewing.cwiseProduct(deformation.tail<3>());
  return force;
}

// Rows are contiguous, so that products with a transpose are sums of columns.
using LaneMatrix3x18 = Eigen::Matrix<Lanes, 3, 18, Eigen::RowMajor>;
using LaneMatrix6x18 = Eigen::Matrix<Lanes, 6, 18, Eigen::RowMajor>;
using LaneMatrix3x6 = Eigen::Matrix<Lanes, 3, 6, Eigen::RowMajor>;
using LaneRow3 = Eigen::Matrix<Lanes, 1, 3>;

SpinCoefficients<Lanes> spin_coefficients(const LaneVec3& theta) {
  const Lanes t2 = theta.squaredNorm();
  if (all_of(t2 < small_square)) {
    return small_spin_coefficients(t2);
  }
  SpinCoefficients<Lanes> result;
  for (std::size_t k = 0; k < lane_count; ++k) {
    const SpinCoefficients<double> one = tunica::spin_coefficients(t2[k]);
    result.eta[k] = one.eta;
    result.mu[k] = one.mu;
  }
  return result;
}

/// Derivatives with respect to displacements and spins, in the frame's axes. All but the strain: of a curved element
/// only.
struct Derivatives {
  LaneMatrix3x18 strain;
  LaneMatrix6x18 slopes;
  LaneMatrix3x18 bulges;
  LaneMatrix3x18 tilts;
};

void add_curved_derivatives(const ElementLanes& element, const Kinematics& now, const std::array<LaneMat3, 3>& h,
                            const std::array<LaneMat3, 3>& g, Derivatives& d) {
  d.slopes.setZero();
  d.tilts.setZero();
  for (int k = 0; k < 3; ++k) {
    const EdgeNow& edge = now.edges[k];
    const auto across = [&](const LaneVec3& carried) {
      return LaneVec3((carried - edge.direction * edge.direction.dot(carried)) / edge.length);
    };
    for (int end = 0; end < 2; ++end) {
      const LaneVec3 normal = element.bending_edges[k] * edge.normal[end];
      auto row = d.slopes.row(2 * k + end);
      row.segment<3>(6 * next_corner(k)) = -across(normal).transpose();
      row.segment<3>(6 * k) = across(normal).transpose();
      row.segment<3>(6 * corner_at(k, end) + 3) = -normal.cross(edge.direction).transpose();
    }
    const LaneRow3 difference = across(edge.side[1] - edge.side[0]).transpose();
    d.strain.block<3, 3>(0, 6 * next_corner(k)) -= element.bow.col(k) * difference;
    d.strain.block<3, 3>(0, 6 * k) += element.bow.col(k) * difference;
    d.strain.block<3, 3>(0, 6 * next_corner(k) + 3) -=
        element.bow.col(k) * edge.side[1].cross(edge.direction).transpose();
    d.strain.block<3, 3>(0, 6 * k + 3) += element.bow.col(k) * edge.side[0].cross(edge.direction).transpose();
  }
  LaneMatrix3x6 of_slopes;
  for (int i = 0; i < 3; ++i) {
    of_slopes.row(i) = element.bulging[i].lazyProduct(now.slopes).transpose();
  }
  d.strain += of_slopes.lazyProduct(d.slopes);
  for (int k = 0; k < 3; ++k) {
    d.bulges.row(k) = d.slopes.row(2 * k) - d.slopes.row(2 * k + 1);
    // Bending rotations follow the spins of the corners less that of the frame.
    LaneRow3 of_frame = LaneRow3::Zero();
    for (const int corner : {k, next_corner(k)}) {
      const LaneRow3 of_spin = 0.5 * element.edge_directions.col(k).transpose() * h[corner].topRows<2>();
      d.tilts.block<1, 3>(k, 6 * corner + 3) = of_spin;
      of_frame += of_spin;
    }
    for (int j = 0; j < 3; ++j) {
      d.tilts.block<1, 3>(k, 6 * j) -= of_frame * g[j];
    }
  }
  const LaneMat3 of_bulges = element.sideways * now.tilts.asDiagonal();
  const LaneMat3 of_tilts = element.sideways * now.bulges.asDiagonal();
  d.strain += of_bulges.lazyProduct(d.bulges) + of_tilts.lazyProduct(d.tilts);
}

/// H: spin to rate of the rotation vector; G_k: spin of the frame from the displacement of corner k.
void find_derivatives(const ElementLanes& element, const Kinematics& now, const std::array<LaneMat3, 3>& h,
                      const std::array<LaneMat3, 3>& g, Derivatives& d) {
  d.strain.setZero();
  // Chord strain: the corners' motion less the turn of the frame about its normal.
  LaneVec3 of_turn = LaneVec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const LaneVec2 gk = element.gradients.col(k);
    d.strain.block<3, 2>(0, 6 * k) << gk.x(), 0, 0, gk.y(), gk.y(), gk.x();
    of_turn += d.strain.block<3, 2>(0, 6 * k) * LaneVec2(now.frame.plane(1, k), -now.frame.plane(0, k));
  }
  for (int k = 0; k < 3; ++k) {
    d.strain.block<3, 3>(0, 6 * k) += of_turn * g[k].row(2);
  }
  if (element.curved) {
    add_curved_derivatives(element, now, h, g, d);
    return;
  }
  for (int k = 0; k < 3; ++k) {
    const LaneVec3 of_rotation = element.bow.col((k + 2) % 3) - element.bow.col(k);
    const LaneMat3 of_spin = of_rotation * h[k].row(2);
    d.strain.block<3, 3>(0, 6 * k + 3) += of_spin;
    for (int j = 0; j < 3; ++j) {
      d.strain.block<3, 3>(0, 6 * j) -= of_spin * g[j];
    }
  }
}

/// Spin of the frame: sum of G_k times the displacement of corner k.
std::array<LaneMat3, 3> frame_spin(const ElementLanes& element, const Frame& frame, LaneMat23& current_gradients) {
  std::array<LaneMat3, 3> g;
  for (int k = 0; k < 3; ++k) {
    const LaneVec2 opposite = frame.plane.col((k + 1) % 3) - frame.plane.col((k + 2) % 3);
    current_gradients.col(k) = LaneVec2(opposite.y(), -opposite.x()) / frame.twice_area;
    g[k] << 0, 0, current_gradients(1, k), 0, 0, -current_gradients(0, k), -element.gradients(1, k) / frame.trace,
        element.gradients(0, k) / frame.trace, 0;
  }
  return g;
}

void rotate_to_world(const LaneMat3& axes, LaneMatrix18& matrix) {
  const LaneMat3 to_world = axes.transpose();
  for (int j = 0; j < 6; ++j) {
    const Eigen::Matrix<Lanes, 18, 3> columns = matrix.middleCols<3>(3 * j).lazyProduct(axes);
    for (int i = 0; i < 6; ++i) {
      matrix.block<3, 3>(3 * i, 3 * j) = to_world.lazyProduct(columns.middleRows<3>(3 * i));
    }
  }
}

/// t += a'b where the sum is symmetric: half of it is computed.
template <typename Rows>
void add_symmetric_product(const Rows& a, const Rows& b, LaneMatrix18& t) {
  for (int j = 0; j < 18; j += 6) {
    for (int i = 0; i <= j; i += 6) {
      const LaneMatrix6 block = a.template middleCols<6>(i).transpose().lazyProduct(b.template middleCols<6>(j));
      t.block<6, 6>(i, j) += block;
      if (i != j) {
        t.block<6, 6>(j, i) += block.transpose();
      }
    }
  }
}

/// The part with the stiffness of the element itself.
void add_material(const ElementLanes& element, double factor, const std::array<LaneMat3, 3>& h,
                  const std::array<LaneMat3, 3>& g, const Derivatives& d, LaneMatrix18& t) {
  const LaneMatrix3x18 stress = (factor * element.membrane).lazyProduct(d.strain);
  add_symmetric_product(d.strain, stress, t);
  if (element.skewed) {
    LaneMatrix3x18 skewness;
    for (int k = 0; k < 3; ++k) {
      skewness.row(k) = 0.5 * (d.slopes.row(2 * k) + d.slopes.row(2 * k + 1));
    }
    const LaneMatrix3x18 on_skewness = (factor * element.skewing).asDiagonal() * skewness;
    add_symmetric_product(skewness, on_skewness, t);
  }
  // Rotation vectors: H_i'K_ij H_j between spins, where spins of the frame count against those of the corners.
  LaneMat3 all = LaneMat3::Zero();
  std::array<LaneMat3, 3> rows{LaneMat3::Zero(), LaneMat3::Zero(), LaneMat3::Zero()};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const LaneMat3 block = factor * h[i].transpose() * element.rotational.block<3, 3>(3 * i, 3 * j) * h[j];
      t.block<3, 3>(6 * i + 3, 6 * j + 3) += block;
      rows[i] += block;
    }
    all += rows[i];
  }
  for (int j = 0; j < 3; ++j) {
    const LaneMat3& gj = g[j];
    for (int i = 0; i < 3; ++i) {
      const LaneMat3 block = rows[i] * gj;
      t.block<3, 3>(6 * i + 3, 6 * j) -= block;
      t.block<3, 3>(6 * j, 6 * i + 3) -= block.transpose();
      t.block<3, 3>(6 * i, 6 * j) += g[i].transpose() * all * gj;
    }
  }
}

/// What the first derivatives of frame and rotation vectors are made of.
struct Linearisation {
  LaneMat23 current_gradients;
  std::array<LaneMat3, 3> g;
  std::array<SpinCoefficients<Lanes>, 3> spin;
  std::array<LaneMat3, 3> h;
};

/// What stresses do on slopes, rotations and corners, in the frame's axes.
struct Resultants {
  LaneMatrix6 slope_stiffness;
  LaneVec3 on_sides;
  std::array<LaneVec3, 3> n, local_moment, moment, force;  ///< of chord strain and rotation vectors
  LaneVec3 total;
  std::array<std::array<LaneVec3, 2>, 3> carried;
  LaneVector18 all;
};

/// What chord strain and rotation vectors add to the geometric stiffness: n are the corners' forces, m their moments.
void add_corotational_stiffness(const ElementLanes& element, const Kinematics& now, const Linearisation& at,
                                const Resultants& of, LaneMatrix18& t) {
  const auto& [current_gradients, g, spin, h] = at;
  const Frame& frame = now.frame;
  // The derivative of H, where spins of the frame count against those of the corners.
  LaneMat3 all = LaneMat3::Zero();
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    const LaneMat3 change = spin_to_rate_derivative(now.rotation(k), of.local_moment[s], spin[s]) * h[s];
    all += change;
    t.block<3, 3>(6 * k + 3, 6 * k + 3) += change;
    for (int j = 0; j < 3; ++j) {
      t.block<3, 3>(6 * k + 3, 6 * j) -= change * g[j];
      t.block<3, 3>(6 * j, 6 * k + 3) -= g[j].transpose() * change;
    }
  }
  // Of the levers q, of G, and of the frame in which the force is expressed.
  LaneMat3 levers = all;
  for (int k = 0; k < 3; ++k) {
    levers += skew(of.n[k]) * skew(LaneVec3(frame.plane(0, k), frame.plane(1, k), 0));
  }
  const LaneVec2 swapped(-of.total.y(), of.total.x());
  const Lanes in_plane = of.total.z() / (frame.trace * frame.trace);
  for (int i = 0; i < 3; ++i) {
    const std::size_t si = i;
    const LaneVec2 gi = current_gradients.col(i);
    const LaneMat3 spun_force = skew(of.force[si]);
    const LaneMat3 spun_moment = skew(of.moment[si]);
    for (int j = 0; j < 3; ++j) {
      const std::size_t sj = j;
      auto block = t.block<3, 3>(6 * i, 6 * j);
      block += g[si].transpose() * (skew(of.n[sj]) + levers * g[sj]) - spun_force * g[sj];
      block.block<1, 2>(2, 0) += swapped.dot(current_gradients.col(j)) * gi.transpose();
      block.row(2) += (gi.x() * swapped.y() - gi.y() * swapped.x()) * g[sj].row(2);
      block.block<2, 2>(0, 0) +=
          in_plane * LaneVec2(-element.gradients(1, i), element.gradients(0, i)) * element.gradients.col(j).transpose();
      t.block<3, 3>(6 * i + 3, 6 * j) -= spun_moment * g[sj];
    }
  }
}

/// Second derivative of e.(R v) for a vector v carried by the end of an edge.
void add_edge_stiffness(const EdgeNow& edge, int start, int carrier, const LaneVec3& carried, LaneMatrix18& t) {
  const LaneVec3& e = edge.direction;
  const int stop = next_corner(start);
  const Lanes value = e.dot(carried);
  const LaneVec3 p = (carried - e * value) / edge.length;
  const LaneMat3 across = (LaneMat3::Identity() - e * e.transpose()) / edge.length;
  const LaneMat3 of_length = (value * across + e * p.transpose() + p * e.transpose()) / edge.length;
  t.block<3, 3>(6 * stop, 6 * stop) -= of_length;
  t.block<3, 3>(6 * start, 6 * start) -= of_length;
  t.block<3, 3>(6 * stop, 6 * start) += of_length;
  t.block<3, 3>(6 * start, 6 * stop) += of_length;
  const LaneMat3 turned = skew(carried) * across;  // its transpose is -across skew(carried)
  const int spin = 6 * carrier + 3;
  t.block<3, 3>(6 * stop, spin) += turned.transpose();
  t.block<3, 3>(6 * start, spin) -= turned.transpose();
  t.block<3, 3>(spin, 6 * stop) += turned;
  t.block<3, 3>(spin, 6 * start) -= turned;
  t.block<3, 3>(spin, spin) += carried * e.transpose() - value * LaneMat3::Identity();
}

/// Slopes and bows: one carried vector per end of an edge collects what works on both.
void add_edge_forces(const Kinematics& now, const LaneVector6& on_slopes, const LaneVec3& on_bows,
                     std::array<std::array<LaneVec3, 2>, 3>& carried, LaneVector18& force) {
  for (int k = 0; k < 3; ++k) {
    const EdgeNow& edge = now.edges[k];
    for (int end = 0; end < 2; ++end) {
      const std::size_t e = end;
      LaneVec3& v = carried[k][e];
      v = -on_slopes[2 * k + end] * edge.normal[e] - (end == 0 ? -on_bows[k] : on_bows[k]) * edge.side[e];
      const LaneVec3 p = (v - edge.direction * edge.direction.dot(v)) / edge.length;
      force.segment<3>(6 * next_corner(k)) += p;
      force.segment<3>(6 * k) -= p;
      force.segment<3>(6 * corner_at(k, end) + 3) += v.cross(edge.direction);
    }
  }
}

void find_resultants(const ElementLanes& element, const Kinematics& now, const Linearisation& at, LaneState stress,
                     Resultants& of) {
  LaneVector6 on_slopes = LaneVector6::Zero();
  of.slope_stiffness.setZero();
  const LaneVec3 on_bows = element.bow.transpose() * stress.head<3>();
  of.on_sides = element.curved ? LaneVec3(element.sideways.transpose() * stress.head<3>()) : LaneVec3(LaneVec3::Zero());
  if (element.curved) {
    for (int i = 0; i < 3; ++i) {
      of.slope_stiffness += stress[i] * element.bulging[i];
    }
    on_slopes = of.slope_stiffness.lazyProduct(now.slopes);
    for (int k = 0; k < 3; ++k) {
      on_slopes[2 * k] += of.on_sides[k] * now.tilts[k] + 0.5 * stress[12 + k];
      on_slopes[2 * k + 1] += -of.on_sides[k] * now.tilts[k] + 0.5 * stress[12 + k];
      on_slopes.segment<2>(2 * k) *= element.bending_edges[k];
      const LaneVec2 on_bending = 0.5 * of.on_sides[k] * now.bulges[k] * element.edge_directions.col(k);
      stress.segment<2>(3 + 3 * k) += on_bending;
      stress.segment<2>(3 + 3 * next_corner(k)) += on_bending;
    }
  } else {
    for (int k = 0; k < 3; ++k) {
      stress[5 + 3 * k] += on_bows[(k + 2) % 3] - on_bows[k];
    }
  }
  of.total.setZero();
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    const LaneVec2 gk = element.gradients.col(k);
    of.n[s] << stress[0] * gk.x() + stress[2] * gk.y(), stress[1] * gk.y() + stress[2] * gk.x(), 0;
    of.local_moment[s] = stress.segment<3>(3 + 3 * k);
    of.moment[s] = at.h[s].transpose() * of.local_moment[s];
    of.total +=
        LaneVec3(0, 0, now.frame.plane(0, k) * of.n[s].y() - now.frame.plane(1, k) * of.n[s].x()) + of.moment[s];
  }
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    of.force[s] = of.n[s] - at.g[s].transpose() * of.total;
    of.all.segment<3>(6 * k) = of.force[s];
    of.all.segment<3>(6 * k + 3) = of.moment[s];
  }
  if (element.curved) {
    add_edge_forces(now, on_slopes, on_bows, of.carried, of.all);
  }
}

void add_curved_stiffness(const Kinematics& now, const Derivatives& d, const Resultants& of, LaneMatrix18& t) {
  const LaneMatrix6x18 on_slope_changes = of.slope_stiffness.lazyProduct(d.slopes);
  add_symmetric_product(d.slopes, on_slope_changes, t);
  const LaneMatrix3x18 on_bulge_changes = of.on_sides.asDiagonal() * d.tilts;
  const LaneMatrix18 coupling = d.bulges.transpose().lazyProduct(on_bulge_changes);
  t += coupling + coupling.transpose();
  for (int k = 0; k < 3; ++k) {
    for (int end = 0; end < 2; ++end) {
      add_edge_stiffness(now.edges[k], k, corner_at(k, end), of.carried[k][end], t);
    }
  }
}

/// Of the state, to first order in displacements and spins (world axes).
LaneState change(const ElementLanes& element, const LaneMat3& axes, const Derivatives& derivatives,
                 const std::array<LaneMat3, 3>& h, const std::array<LaneMat3, 3>& g, const LaneVector18& motion) {
  LaneVector18 local;
  for (int k = 0; k < 6; ++k) {
    local.segment<3>(3 * k) = axes * motion.segment<3>(3 * k);
  }
  LaneVec3 spin = LaneVec3::Zero();
  for (int k = 0; k < 3; ++k) {
    spin += g[k] * local.segment<3>(6 * k);
  }
  LaneState state = LaneState::Zero();
  state.head<3>() = derivatives.strain.lazyProduct(local);
  if (element.curved) {
    const LaneVector6 slopes = derivatives.slopes.lazyProduct(local);
    for (int k = 0; k < 3; ++k) {
      state[12 + k] = 0.5 * (slopes[2 * k] + slopes[2 * k + 1]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    state.segment<3>(3 + 3 * k) = h[k] * (local.segment<3>(6 * k + 3) - spin);
  }
  return state;
}

/// What the derivatives need at the reference.
struct Reference {
  Derivatives derivatives;
  std::array<LaneMat3, 3> h{LaneMat3::Identity(), LaneMat3::Identity(), LaneMat3::Identity()};
  std::array<LaneMat3, 3> g;
};

Reference find_reference(const ElementLanes& element) {
  Kinematics now;
  find_kinematics(element, no_motion(), now);
  LaneMat23 gradients;
  Reference reference;
  reference.g = frame_spin(element, now.frame, gradients);
  find_derivatives(element, now, reference.h, reference.g, reference.derivatives);
  return reference;
}

}  // namespace

void gather(const ElementGroup& elements, ElementLanes& lanes) {
  lanes.skewed = false;
  lanes.curved = elements[0]->curved;
  const auto pack = [&](auto member, auto& to) {
    set_lanes(
        to, [&](std::size_t k) -> const auto& { return elements[k]->*member; });
  };
  pack(&ShellElement::axes, lanes.axes);
  pack(&ShellElement::from_centroid, lanes.from_centroid);
  pack(&ShellElement::plane, lanes.plane);
  pack(&ShellElement::gradients, lanes.gradients);
  pack(&ShellElement::edge_normals, lanes.edge_normals);
  pack(&ShellElement::edge_sides, lanes.edge_sides);
  pack(&ShellElement::slopes, lanes.slopes);
  pack(&ShellElement::rest_normals, lanes.rest_normals);
  pack(&ShellElement::rest_sides, lanes.rest_sides);
  pack(&ShellElement::bow, lanes.bow);
  pack(&ShellElement::bending_edges, lanes.bending_edges);
  pack(&ShellElement::height_weights, lanes.height_weights);
  pack(&ShellElement::sideways, lanes.sideways);
  pack(&ShellElement::tilts, lanes.tilts);
  pack(&ShellElement::edge_directions, lanes.edge_directions);
  pack(&ShellElement::membrane, lanes.membrane);
  pack(&ShellElement::rotational, lanes.rotational);
  pack(&ShellElement::skewing, lanes.skewing);
  pack(&ShellElement::prestrain, lanes.prestrain);
  for (std::size_t form = 0; form < 3; ++form) {
    set_lanes(
        lanes.bulging[form], [&](std::size_t k) -> const auto& { return elements[k]->bulging[form]; });
  }
  for (const ShellElement* e : elements) {
    TUNICA_ASSERT(e->curved == lanes.curved);
    lanes.skewed = lanes.skewed || !e->skewing.isZero(0);
  }
}

ElementLanes same(const ShellElement& element) {
  ElementGroup group;
  group.fill(&element);
  ElementLanes lanes;
  gather(group, lanes);
  return lanes;
}

MotionLanes same(const CornerMotion& motion) {
  MotionLanes lanes;
  lanes.displacement = motion.displacement.cast<Lanes>();
  for (std::size_t k = 0; k < 3; ++k) {
    lanes.rotation[k] = motion.rotation[k].cast<Lanes>();
  }
  return lanes;
}

LaneMask deformation(const ElementLanes& element, const MotionLanes& motion, LaneState& result) {
  Kinematics now;
  const LaneMask valid = find_kinematics(element, motion, now);
  result = now.state;
  return valid;
}

LaneState linear_deformation(const ElementLanes& element, const LaneVector18& motion) {
  const Reference reference = find_reference(element);
  return change(element, element.axes, reference.derivatives, reference.h, reference.g, motion);
}

LaneVector18 linear_force(const ElementLanes& element, const LaneVector18& motion) {
  LaneVector18 less = motion;  // a common displacement strains nothing, not even by round-off
  for (int k = 0; k < 3; ++k) {
    less.segment<3>(6 * k) -= motion.head<3>();
  }
  const LaneState stress = element_force(element, linear_deformation(element, less) + element.prestrain);
  const Reference reference = find_reference(element);
  LaneVector18 local = reference.derivatives.strain.transpose().lazyProduct(stress.head<3>());
  LaneVec3 total = LaneVec3::Zero();
  for (int k = 0; k < 3; ++k) {
    if (element.skewed) {
      local += 0.5 * stress[12 + k] *
               (reference.derivatives.slopes.row(2 * k) + reference.derivatives.slopes.row(2 * k + 1)).transpose();
    }
    const LaneVec3 moment = stress.segment<3>(3 + 3 * k);
    local.segment<3>(6 * k + 3) += moment;
    total += moment;
  }
  LaneVector18 force;
  for (int k = 0; k < 3; ++k) {
    local.segment<3>(6 * k) -= reference.g[k].transpose() * total;
    force.segment<3>(6 * k) = element.axes.transpose() * local.segment<3>(6 * k);
    force.segment<3>(6 * k + 3) = element.axes.transpose() * local.segment<3>(6 * k + 3);
  }
  return force;
}

LaneMatrix18 linear_stiffness(const ElementLanes& element) {
  const Reference reference = find_reference(element);
  LaneMatrix18 stiffness = LaneMatrix18::Zero();
  add_material(element, 1, reference.h, reference.g, reference.derivatives, stiffness);
  rotate_to_world(element.axes, stiffness);
  return stiffness;
}

LaneState predicted_deformation(const ElementLanes& element, const MotionLanes& motion, const LaneVector18& increment) {
  Kinematics now;
  find_kinematics(element, motion, now);
  LaneMat23 unused;
  const std::array<LaneMat3, 3> g = frame_spin(element, now.frame, unused);
  std::array<LaneMat3, 3> h;
  for (int k = 0; k < 3; ++k) {
    h[k] = spin_to_rate(now.rotation(k), spin_coefficients(now.rotation(k)).eta);
  }
  Derivatives derivatives;
  find_derivatives(element, now, h, g, derivatives);
  return now.state + change(element, now.frame.axes, derivatives, h, g, increment);
}

LaneMask corotational_response(const ElementLanes& element, const MotionLanes& motion, const ViscousLanes& viscous,
                               ResponseLanes& response, LaneMatrix18* tangent, const LaneState* predicted) {
  Kinematics now;
  const LaneMask valid = find_kinematics(element, motion, now);
  response.deformation = now.state;
  const auto stress_of = [&](const LaneState& state) {
    LaneState stress = element_force(element, state + element.prestrain);
    if (viscous.factor > 0) {
      stress += viscous.factor * element_force(element, state - viscous.previous);
    }
    return stress;
  };
  response.energy = now.state.dot(element_force(element, 0.5 * now.state + element.prestrain));
  Linearisation at;
  at.g = frame_spin(element, now.frame, at.current_gradients);
  for (int k = 0; k < 3; ++k) {
    const std::size_t s = k;
    at.spin[s] = spin_coefficients(now.rotation(k));
    at.h[s] = spin_to_rate(now.rotation(k), at.spin[s].eta);
  }
  Resultants resultants;
  find_resultants(element, now, at, stress_of(now.state), resultants);
  for (int k = 0; k < 6; ++k) {
    response.force.segment<3>(3 * k) = now.frame.axes.transpose() * resultants.all.segment<3>(3 * k);
  }
  if (tangent == nullptr) {
    return valid;
  }
  if (predicted != nullptr) {
    find_resultants(element, now, at, stress_of(*predicted), resultants);
  }
  Derivatives d;
  find_derivatives(element, now, at.h, at.g, d);
  LaneMatrix18& t = *tangent;
  t.setZero();
  add_material(element, 1 + viscous.factor, at.h, at.g, d, t);
  add_corotational_stiffness(element, now, at, resultants, t);
  if (element.curved) {
    add_curved_stiffness(now, d, resultants, t);
  }
  rotate_to_world(now.frame.axes, t);
  return valid;
}

}  // namespace tunica
