#include "tunica/core/threads.hpp"
#include "tunica/mechanics/contact/detail/contact_parts.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/shell/patch/shape_function.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t groups_per_task = 16;
constexpr double least_part_of_mean = 0.1;   // pressure, below which an area does not count
constexpr double largest_expectation = 100;  // pressures that the tangent takes stay within this of the law's

void add_block(BlockMatrix& matrix, Index row, Index column, const Matrix6& block) {
  const auto begin = matrix.column.begin() + narrow<std::ptrdiff_t>(matrix.row_start[row]);
  const auto end = matrix.column.begin() + narrow<std::ptrdiff_t>(matrix.row_start[row + 1]);
  const auto place = std::lower_bound(begin, end, column);
  if (place != end && *place == column) {  // else the pair came near within this step: the forces are there
    matrix.block(narrow<std::size_t>(place - matrix.column.begin())) += block;
  }
}

/// Forces and moments of the nodes by a force at a point, by the paper's rule: the force goes to the corners by
/// barycentric coordinates, and its part across the facet makes moments there by the shape function, (C^-1)' w(x, y).
/// Source: Comas, Duriez, Cotin 2010, section 2. Limits: the moments are not in balance with the forces.
Eigen::Matrix<double, 18, 3> paper_transfer(const PatchMap& map, const Vec2& at) {
  const Vec3 origin = map.points().col(0), e1 = map.points().col(1) - origin, e2 = map.points().col(2) - origin;
  const Vec3 x = e1.normalized(), z = e1.cross(e2).normalized(), y = z.cross(x);
  const PlaneTriangle triangle{e1.norm(), e2.dot(x), e2.dot(y)};
  const Vec3 flat = at[0] * e1 + at[1] * e2;
  const Vector9 values = inverse_shape_matrix(triangle).transpose() * monomials(flat.dot(x), flat.dot(y));
  const Vec3 shares(1 - at[0] - at[1], at[0], at[1]);
  Eigen::Matrix<double, 18, 3> transfer;
  for (int k = 0; k < 3; ++k) {
    transfer.middleRows<3>(6 * k) = shares[k] * Mat3::Identity();
    // By dw/dy and -dw/dx.
    transfer.middleRows<3>(6 * k + 3) = (values[3 * k + 1] * x + values[3 * k + 2] * y) * z.transpose();
  }
  return transfer;
}

/// What friction adds on nodes because it acts on a face of the wall, not on its middle.
struct Turning {
  Vector18 moments = Vector18::Zero();
  Matrix18 own = Matrix18::Zero(), there = Matrix18::Zero(), back = Matrix18::Zero();
};

/// How a lever moves with the spins of the nodes.
Eigen::Matrix<double, 3, 18> lever_derivative(const Vec2& at, const Vec3& lever) {
  const Vec3 shares(1 - at[0] - at[1], at[0], at[1]);
  Eigen::Matrix<double, 3, 18> result = Eigen::Matrix<double, 3, 18>::Zero();
  for (int k = 0; k < 3; ++k) {
    result.middleCols<3>(6 * k + 3) = -shares[k] * skew(lever);
  }
  return result;
}

/// What the samples of a face do to one other face.
struct Other {
  PatchMap::Points forces = PatchMap::Points::Zero();
  PatchMap::Matrix27 own = PatchMap::Matrix27::Zero();
  PatchMap::Matrix27 between = PatchMap::Matrix27::Zero();  ///< rows: of the face that is sampled
  PatchMap::Matrix27 turned = PatchMap::Matrix27::Zero();   ///< likewise, symmetric with what stands across
  Turning turning;
};

/// How the normal of the other surface turns with it, and its nearest point moves along it: the second derivative of
/// the distance, the other surface being flat.
/// @param force  N, along the normal; distance  mm, of the point from the other surface
/// Source: Laursen, Simo 1993, "A continuum-based finite element formulation for the implicit solution of multibody,
/// large deformation frictional contact problems".
void add_turn_of_normal(const SurfaceFace& other, const PatchMap& its_map, const Vec2& at, const PatchWeights& own,
                        const PatchWeights& theirs, const Vec3& normal, double force, double distance, Other& act) {
  using Vector27 = Eigen::Matrix<double, 27, 1>;
  const auto outer = [](const PatchWeights& weights, const Vec3& direction) {
    Vector27 result;
    for (int k = 0; k < 9; ++k) {
      result.segment<3>(3 * k) = weights[k] * direction;
    }
    return result;
  };
  const auto along = patch_weight_derivatives(other, at);
  const std::array<Vec3, 2> t{its_map.point(along[0]), its_map.point(along[1])};
  Eigen::Matrix2d metric;
  metric << t[0].dot(t[0]), t[0].dot(t[1]), t[1].dot(t[0]), t[1].dot(t[1]);
  const Eigen::Matrix2d inverse = metric.inverse();
  const std::array<Vector27, 2> turns{outer(along[0], normal), outer(along[1], normal)};
  for (int a = 0; a < 2; ++a) {
    const Vec3 dual = inverse(a, 0) * t[0] + inverse(a, 1) * t[1];
    const Vector27 turn_dual = inverse(a, 0) * turns[0] + inverse(a, 1) * turns[1];
    const Vector27 slides = distance * turn_dual - outer(theirs, dual);
    act.turned += force * outer(own, dual) * turns[a].transpose();
    act.own += force * (turns[a] * slides.transpose() + slides * turns[a].transpose() -
                        distance * turns[a] * turn_dual.transpose());
  }
}

void add_to_other(const SurfaceFace& other, const PatchMap& its_map, const Other& act, VectorX& external,
                  BlockMatrix* tangent) {
  const Vector18 on_nodes = its_map.to_nodes(act.forces) + act.turning.moments;
  for (int k = 0; k < 3; ++k) {
    external.segment<6>(first_freedom(other.nodes[k])) += on_nodes.segment<6>(6 * k);
  }
  if (tangent == nullptr) {
    return;
  }
  const Matrix18 own = its_map.stiffness(act.own, -act.forces) + act.turning.own;
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < 3; ++l) {
      add_block(*tangent, other.nodes[k], other.nodes[l], own.block<6, 6>(6 * k, 6 * l));
    }
  }
}

void add_between(const SurfaceFace& face, const SurfaceFace& other, const PatchMap& map, const PatchMap& its_map,
                 const Other& act, BlockMatrix& tangent) {
  PatchMap::Matrix27 backwards;
  for (int k = 0; k < 9; ++k) {
    for (int l = 0; l < 9; ++l) {
      backwards.block<3, 3>(3 * l, 3 * k) = act.between.block<3, 3>(3 * k, 3 * l);
    }
  }
  const Matrix18 there =
      map.jacobian().transpose() * ((act.between + act.turned) * its_map.jacobian()) + act.turning.there;
  const Matrix18 back =
      its_map.jacobian().transpose() * ((backwards + act.turned.transpose()) * map.jacobian()) + act.turning.back;
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < 3; ++l) {
      add_block(tangent, face.nodes[k], other.nodes[l], there.block<6, 6>(6 * k, 6 * l));
      add_block(tangent, other.nodes[k], face.nodes[l], back.block<6, 6>(6 * k, 6 * l));
    }
  }
}

}  // namespace

ContactSystem::Levers ContactSystem::levers(const Group& group, const Touch& touch) const {
  const Contact& contact = contacts_[group.contact];
  if (contact.friction == 0 || !contact.consistent) {
    return {};
  }
  // The nodes of solids have no rotations: where both are solids, friction acts at both ends of the gap.
  const double distance = touch.gap + group.sag + offset(group, touch.face);
  const double theirs = group.other.rigid ? 0 : surfaces_.faces[touch.face].half_thickness;
  if (group.point) {
    return {Vec3::Zero(), theirs * touch.normal};
  }
  if (surfaces_.faces[group.face].half_thickness > 0) {
    return {(theirs - distance) * touch.normal, theirs * touch.normal};
  }
  return {Vec3::Zero(), theirs > 0 ? Vec3(distance * touch.normal) : Vec3(Vec3::Zero())};
}

Vec3 ContactSystem::lever_before(const SurfaceFace& face, const Vec2& at, const Vec3& lever,
                                 const FaceMaps& maps) const {
  const Vec3 shares(1 - at[0] - at[1], at[0], at[1]);
  Vec3 before = Vec3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Index node = face.nodes[k];
    before += shares[k] *
              (accepted_->configuration().rotation[node] * (maps.configuration().rotation[node].conjugate() * lever));
  }
  return before;
}

Vec3 ContactSystem::relative_motion(const Group& group, const Sample& sample, const Touch& touch, const Vec3& x,
                                    const FaceMaps& maps) const {
  if (!sample.followed) {
    return Vec3::Zero();
  }
  const Levers lever = levers(group, touch);
  const Vec3 before = group.point
                          ? sample.before
                          : Vec3(sample.before + lever_before(surfaces_.faces[group.face], sample.at, lever.own, maps));
  if (group.other.rigid) {
    return x + lever.own - shapes_[group.other.index].carried(before, shapes_before_[group.other.index]);
  }
  // The point of the other surface that is touched now has come from its place in the last accepted state.
  const SurfaceFace& face = surfaces_.faces[touch.face];
  const Vec3 there = x - touch.normal * (touch.gap + group.sag + offset(group, touch.face));
  const Vec3 there_before =
      (*accepted_)[touch.face].point(touch.weights) + lever_before(face, touch.at, lever.other, maps);
  return (x + lever.own - before) - (there + lever.other - there_before);
}

std::vector<ContactSystem::Touches> ContactSystem::all_touches(const FaceMaps& maps,
                                                               const std::vector<std::vector<std::size_t>>& near) {
  std::vector<Touches> touches(groups_.size());
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    group.close = is_close(group, near[g], maps);
    if (!group.close) {
      continue;
    }
    wake(group);
    if (!group.point) {
      maps.prepare(group.face);
    }
    for (const std::size_t f : near[g]) {
      maps.prepare(f);
    }
  }
  parallel_for_blocks(groups_.size(), groups_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      const Group& group = groups_[g];
      for (std::size_t i = 0; group.close && i < group.samples.size(); ++i) {
        const Touch found = touch(group, place(group, group.samples[i], maps), near[g], maps);
        if (found.gap < group.resolution) {
          touches[g].emplace_back(i, found);
        }
      }
    }
  });
  return touches;
}

/// What acts on one face: forces on its points, with and without what the rest of a motion adds, and their derivative.
struct ContactSystem::Acting {
  PatchMap::Points forces = PatchMap::Points::Zero();
  PatchMap::Points at_rest = PatchMap::Points::Zero();
  PatchMap::Matrix27 stiffness = PatchMap::Matrix27::Zero();
  std::map<std::size_t, Other> others;
  Turning turning;
  Vector18 by_the_paper = Vector18::Zero();  ///< instead of `forces`, where the contact asks for it
  Matrix18 paper_stiffness = Matrix18::Zero();
  bool any = false;
};

ContactSystem::Press ContactSystem::press(const Group& group, const Sample& sample, const Touch& t, const Vec3& x,
                                          const FaceMaps& maps) const {
  const double friction = contacts_[group.contact].friction;
  const Barrier& barrier = barriers_[group.contact];
  Press press;
  press.law = barrier.pressure(t.gap, group.resolution);
  const double expected = sample.pressure < 0 ? press.law
                                              : std::clamp(sample.pressure, press.law / largest_expectation,
                                                           press.law * largest_expectation);
  press.slope = barrier.slope(t.gap, group.resolution, expected);
  const Vec3& n = t.normal;
  press.traction = press.law * n;
  press.derivative = press.slope * n * n.transpose() - press.law * t.curvature;
  if (friction > 0) {
    const Mat3 across = Mat3::Identity() - n * n.transpose();
    press.slip = across * (sample.slip + relative_motion(group, sample, t, x, maps));
    const double length = std::max(press.slip.norm(), group.elastic_slip);
    const Vec3 direction = press.slip / length;
    Mat3 of_slip = across;
    if (press.slip.norm() > group.elastic_slip) {
      of_slip -= direction * direction.transpose();
    }
    press.traction -= friction * press.law * direction;
    press.derivative += friction * (expected / length * of_slip - press.slope * direction * n.transpose());
  }
  return press;
}

/// What the rest of the rigid body's motion adds to a traction: as if the surface moved back by that.
Vec3 ContactSystem::rest_of_motion(const Group& group, const Press& press, const Touch& t, const Vec3& x) const {
  if (left_ > 0 && group.point) {
    return -press.derivative * (shapes_end_[group.rigid].of_mesh(*group.point) - x);
  }
  if (left_ == 0 || !group.other.rigid) {
    return Vec3::Zero();
  }
  const RigidShape& now = shapes_[group.other.index];
  const RigidShape& then = shapes_end_[group.other.index];
  const double closes = then.at(x).distance - now.at(x).distance;
  const Vec3 moved = then.carried(x, now) - x;
  return -press.derivative * (closes * t.normal - (moved - t.normal * t.normal.dot(moved)));
}

void ContactSystem::record(const Group& group, const Sample& sample, const FaceMaps& maps, const Touch& t,
                           const Press& press) {
  const Contact& contact = contacts_[group.contact];
  const Vec3 x = place(group, sample, maps) + levers(group, t).own;
  const Vec3 force = group.weight * sample.area * press.traction;
  ContactState& result = recorded_->states[group.contact];
  const std::size_t body = group.point ? SIZE_MAX : surfaces_.faces[group.face].body;
  const bool on_first =
      group.point ? contact.between[0].rigid : !contact.between[0].rigid && contact.between[0].index == body;
  // What a body does to itself adds up to nothing.
  const bool self = !group.other.rigid && group.other.index == body;
  const double sign = self ? 0 : on_first ? 1 : -1;
  result.force += sign * force;
  result.moment += sign * x.cross(force);
  double area = sample.area;
  if (!group.point) {
    const auto along = patch_weight_derivatives(surfaces_.faces[group.face], sample.at);
    const PatchMap& map = maps[group.face];
    area = sample.share * map.point(along[0]).cross(map.point(along[1])).norm();
    recorded_->pressing[group.contact].push_back({press.law, group.weight * area});
  }
  ++result.points;
  if (contact.friction > 0) {
    result.slip = std::max(result.slip, sample.slipped + std::max(0.0, press.slip.norm() - group.elastic_slip));
  }
  if (group.other.rigid || group.point) {
    RigidState& rigid = on_rigids_[group.point ? group.rigid : group.other.index];
    const double on_it = group.point ? 1 : -1;
    rigid.force += on_it * force;
    rigid.moment += on_it * x.cross(force);
  }
}

void ContactSystem::add_turning(const Group& group, const Sample& sample, const Touch& t, double area,
                                const Press& press, const Vec3& rest, bool with_derivative, const FaceMaps& maps,
                                Acting& acting) const {
  using Derivative = Eigen::Matrix<double, 3, 18>;
  const Levers lever = levers(group, t);
  Other* const other = t.face == SIZE_MAX ? nullptr : &acting.others[t.face];
  const Derivative own = lever_derivative(sample.at, lever.own);
  const Derivative theirs = lever_derivative(t.at, lever.other);
  acting.turning.moments += area * own.transpose() * (press.traction + rest);
  if (other != nullptr) {
    other->turning.moments -= area * theirs.transpose() * (press.traction + rest);
  }
  if (!with_derivative) {
    return;
  }
  // What (point + lever) adds to the derivative for the point alone.
  const auto more = [&](const Derivative& x, const Derivative& l, const Derivative& y, const Derivative& m) {
    return Matrix18(area *
                    ((x + l).transpose() * (press.derivative * (y + m)) - x.transpose() * (press.derivative * y)));
  };
  const Derivative x =
      group.point ? Derivative(Derivative::Zero()) : Derivative(maps.linearised(group.face).derivative(sample.weights));
  acting.turning.own += more(x, own, x, own);
  if (other != nullptr) {
    const Derivative y = maps.linearised(t.face).derivative(t.weights);
    other->turning.own += more(y, theirs, y, theirs);
    other->turning.there -= more(x, own, y, theirs);
    other->turning.back -= more(y, theirs, x, own);
  }
}

/// Adds one sample to what acts on its face and on the face it meets.
void ContactSystem::add_sample(const Group& group, const Sample& sample, const Touch& t, const Press& press,
                               const Vec3& rest, bool with_derivative, const FaceMaps& maps, Acting& acting) const {
  const double area = group.weight * sample.area;
  acting.any = true;
  acting.at_rest += area * press.traction * sample.weights.transpose();
  acting.forces += area * (press.traction + rest) * sample.weights.transpose();
  Other* const other = t.face == SIZE_MAX ? nullptr : &acting.others[t.face];
  if (other != nullptr) {
    other->forces -= area * (press.traction + rest) * t.weights.transpose();
  }
  if (contacts_[group.contact].friction > 0 && contacts_[group.contact].consistent) {
    add_turning(group, sample, t, area, press, rest, with_derivative, maps, acting);
  }
  if (other != nullptr && with_derivative && t.on_face) {
    add_turn_of_normal(surfaces_.faces[t.face], maps[t.face], t.at, sample.weights, t.weights, t.normal,
                       area * press.law, t.gap + group.sag + offset(group, t.face), *other);
  }
  for (int k = 0; with_derivative && k < 9; ++k) {
    for (int l = 0; l < 9; ++l) {
      const auto add = [&](double weight, PatchMap::Matrix27& to) {
        if (weight != 0) {
          to.block<3, 3>(3 * k, 3 * l) += weight * press.derivative;
        }
      };
      add(area * sample.weights[k] * sample.weights[l], acting.stiffness);
      if (other != nullptr) {
        add(area * t.weights[k] * t.weights[l], other->own);
        add(-area * sample.weights[k] * t.weights[l], other->between);
      }
    }
  }
}

void ContactSystem::scatter(const Group& group, const Acting& acting, const FaceMaps& maps, VectorX& external,
                            BlockMatrix* tangent) const {
  if (group.point) {
    for (const auto& [number, other] : acting.others) {
      add_to_other(surfaces_.faces[number], maps.linearised(number), other, external, tangent);
    }
    return;
  }
  const SurfaceFace& face = surfaces_.faces[group.face];
  PatchMap& map = maps.linearised(group.face);
  const Vector18 on_nodes = contacts_[group.contact].consistent
                                ? Vector18(map.to_nodes(acting.forces) + acting.turning.moments)
                                : acting.by_the_paper;
  for (int k = 0; k < 3; ++k) {
    external.segment<6>(first_freedom(face.nodes[k])) += on_nodes.segment<6>(6 * k);
  }
  if (tangent != nullptr) {
    const Matrix18 of_nodes = contacts_[group.contact].consistent
                                  ? Matrix18(map.stiffness(acting.stiffness, -acting.at_rest) + acting.turning.own)
                                  : acting.paper_stiffness;
    for (int k = 0; k < 3; ++k) {
      for (int l = 0; l < 3; ++l) {
        add_block(*tangent, face.nodes[k], face.nodes[l], of_nodes.block<6, 6>(6 * k, 6 * l));
      }
    }
  }
  for (const auto& [number, other] : acting.others) {
    add_to_other(surfaces_.faces[number], maps.linearised(number), other, external, tangent);
    if (tangent != nullptr) {
      add_between(face, surfaces_.faces[number], map, maps.linearised(number), other, *tangent);
    }
  }
}

bool ContactSystem::add(const Configuration& configuration, VectorX& external, BlockMatrix* tangent) {
  const auto kept = maps_at(configuration);
  const FaceMaps& maps = *kept;
  const auto touches = all_touches(maps, near_faces(maps, 0));
  std::ranges::for_each(barriers_, &Barrier::begin);
  slides_ = false;
  closest_ = {};
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    Acting acting;
    auto pressing = touches[g].begin();
    for (std::size_t i = 0; i < group.samples.size(); ++i) {
      Sample& sample = group.samples[i];
      sample.active = sample.active && tangent == nullptr;
      if (pressing == touches[g].end() || pressing->first != i) {
        continue;
      }
      const Touch& t = (pressing++)->second;
      if (t.gap < closest_.gap) {
        closest_ = {t.gap, group.contact, place(group, sample, maps)};
      }
      if (t.gap < -deepest(group, t.face)) {
        return false;
      }
      const Vec3 x = place(group, sample, maps);
      const Press here = press(group, sample, t, x, maps);
      Barrier& barrier = barriers_[group.contact];
      barrier.press(t.gap, group.resolution, here.law, group.weight * sample.area);
      if (recorded_ != nullptr) {
        record(group, sample, maps, t, here);
      }
      Vec3 rest = Vec3::Zero();
      if (tangent != nullptr) {
        sample.active = true;
        sample.law = here.law;
        sample.slope = here.slope;
        sample.normal = t.normal;
        sample.other = t.face;
        sample.other_weights = t.weights;
        rest = rest_of_motion(group, here, t, x);
      }
      add_sample(group, sample, t, here, rest, tangent != nullptr, maps, acting);
      slides_ = slides_ || here.slip.norm() > group.elastic_slip;
      if (!contacts_[group.contact].consistent && !group.point) {
        const double area = group.weight * sample.area;
        const auto transfer = paper_transfer(maps[group.face], sample.at);
        acting.by_the_paper += area * transfer * (here.traction + rest);
        if (tangent != nullptr) {
          acting.paper_stiffness +=
              area * transfer * (here.derivative * maps.linearised(group.face).derivative(sample.weights));
        }
      }
    }
    if (acting.any) {
      scatter(group, acting, maps, external, tangent);
    }
  }
  if (tangent != nullptr) {
    at_tangent_ = kept;
    shapes_at_tangent_ = shapes_;
  }
  return true;
}

void ContactSystem::predict(const VectorX& increment) {
  const FaceMaps& maps = *at_tangent_;
  const auto change_of = [&](std::size_t f) {
    const SurfaceFace& face = surfaces_.faces[f];
    Vector18 of_nodes;
    for (int k = 0; k < 3; ++k) {
      of_nodes.segment<6>(6 * k) = increment.segment<6>(first_freedom(face.nodes[k]));
    }
    return maps.linearised(f).change(of_nodes);
  };
  for (Group& group : groups_) {
    std::optional<PatchMap::Points> own;
    for (Sample& sample : group.samples) {
      if (!sample.active) {
        sample.pressure = -1;
        continue;
      }
      Vec3 moved = Vec3::Zero();
      if (group.point) {
        moved = shapes_[group.rigid].of_mesh(*group.point) - shapes_at_tangent_[group.rigid].of_mesh(*group.point);
      } else {
        own = own ? own : change_of(group.face);
        moved = *own * sample.weights;
      }
      if (sample.other != SIZE_MAX) {
        moved -= change_of(sample.other) * sample.other_weights;
      } else if (group.other.rigid) {
        const Vec3 x = maps[group.face].point(sample.weights);
        moved += (shapes_[group.other.index].at(x).distance - shapes_at_tangent_[group.other.index].at(x).distance) *
                 sample.normal;
      }
      sample.pressure = std::max(sample.law - sample.slope * sample.normal.dot(moved), 0.0);
    }
  }
}

/// The area with more than a small part of the mean pressure: beyond it the law of contact presses at a distance.
double pressing_area(const std::vector<ContactSystem::Pressing>& pressing) {
  double force = 0, squared = 0, area = 0;
  for (const auto& [pressure, of] : pressing) {
    force += of * pressure;
    squared += of * pressure * pressure;
  }
  for (const auto& [pressure, of] : pressing) {
    area += pressure * force > least_part_of_mean * squared ? of : 0;
  }
  return area;
}

std::vector<ContactState> ContactSystem::results(const Configuration& configuration) {
  Recorded recorded{std::vector<ContactState>(contacts_.size()), std::vector<std::vector<Pressing>>(contacts_.size())};
  std::vector<ContactState>& results = recorded.states;
  on_rigids_.assign(shapes_.size(), {});
  VectorX nodal = VectorX::Zero(first_freedom(reference_.size()));
  recorded_ = &recorded;
  (void)add(configuration, nodal, nullptr);
  recorded_ = nullptr;
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    results[c].area = pressing_area(recorded.pressing[c]);
  }
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  double forces = 0, moments = 0;
  for (std::size_t i = 0; i < reference_.size(); ++i) {
    const Vec3 f = nodal.segment<3>(first_freedom(i)), m = nodal.segment<3>(first_freedom(i) + 3);
    const Vec3 x = reference_[i] + configuration.displacement[i];
    force += f;
    moment += x.cross(f) + m;
    forces += f.norm();
    moments += x.norm() * f.norm() + m.norm();
  }
  for (std::size_t r = 0; r < shapes_.size(); ++r) {
    on_rigids_[r].position = shapes_[r].position();
    force += on_rigids_[r].force;
    moment += on_rigids_[r].moment;
  }
  imbalance_ = {forces > 0 ? force.norm() / forces : 0, moments > 0 ? moment.norm() / moments : 0};
  const auto kept = maps_at(configuration);
  const FaceMaps& maps = *kept;
  const auto near = near_faces(maps, 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (!is_close(group, near[g], maps)) {
      continue;
    }
    ContactState& result = results[group.contact];
    double upper = infinity;
    for (const Sample& sample : group.samples) {
      upper = std::min(upper, touch(group, place(group, sample, maps), near[g], maps).gap + group.sag);
    }
    if (std::isfinite(upper)) {
      result.gap_upper = std::fmin(result.gap_upper, upper);
      result.gap_lower = std::fmin(result.gap_lower, group.point ? upper : lower_gap(group, near[g], maps, upper));
    }
  }
  return results;
}

}  // namespace tunica
