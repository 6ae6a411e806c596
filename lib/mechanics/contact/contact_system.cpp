#include "tunica/mechanics/contact/contact_system.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/patch/shape_function.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

namespace tunica {
namespace {

constexpr double first_stiffness = 1e-5;       // of the barrier, of Young's modulus, while no pressure is known
constexpr double least_stiffness = 1e-8;       // of the barrier, of Young's modulus: where a contact opens
constexpr double stiffness_of_pressure = 0.1;  // of the barrier, of the mean pressure
constexpr double blunt = 0.5;                  // of the mean pressure: above, the barrier is made softer
constexpr double hardening = 4;                // of the barrier, where a state of rest overlaps
/// Part of the resolution below which the law goes on as a straight line, also where surfaces overlap on the way.
constexpr double straight_below = 0.1;
/// Part of both half walls up to which shells may overlap on the way.
constexpr double largest_overlap = 0.8;
constexpr double elastic_slip_of_wall = 1e-3;  // slip at which friction is fully there
constexpr double sag_of_resolution = 0.02;     // what a surface may bend between samples
constexpr int least_level = 4, most_level = 32;
constexpr std::size_t groups_per_task = 16;
constexpr int most_refined = 5;              // times that a part is split for a certificate
constexpr double largest_expectation = 100;  // pressures that the tangent takes stay within this of the law's

/// Two surfaces of one body are as far apart as they were in the reference: this part of it counts as no contact.
constexpr double own_distance = 0.9;

struct Bounds {
  Vec3 lower, upper;

  [[nodiscard]] bool meets(const Bounds& other, double more) const {
    return ((lower.array() - more) <= other.upper.array()).all() &&
           ((other.lower.array() - more) <= upper.array()).all();
  }
};

Bounds bounds_of(const SurfaceFace& face, const PatchMap& map) {
  // The surface lies in the hull of its control points; the centre follows them by weights that may leave it a little.
  const auto points = map.points().leftCols(face.curved ? 9 : 3);
  Bounds bounds{points.rowwise().minCoeff(), points.rowwise().maxCoeff()};
  if (face.curved) {
    Vec3 centre = Vec3::Zero();
    for (int k = 0; k < 9; ++k) {
      centre += face.centre[k] * points.col(k);
    }
    bounds.lower = bounds.lower.cwiseMin(centre);
    bounds.upper = bounds.upper.cwiseMax(centre);
  }
  return bounds;
}

CubicPatch patch_of(const SurfaceFace& face, const PatchMap& map) {
  CubicPatch patch;
  patch.control[9].setZero();
  for (int k = 0; k < 9; ++k) {
    patch.control[k] = map.points().col(k);
    patch.control[9] += face.centre[k] * map.points().col(k);
  }
  return patch;
}

/// Parts of a face: triangles of its parameters.
struct Part {
  std::array<Vec2, 3> at;

  [[nodiscard]] std::array<Part, 4> split() const {
    const Vec2 a = (at[0] + at[1]) / 2, b = (at[1] + at[2]) / 2, c = (at[2] + at[0]) / 2;
    return {Part{{at[0], a, c}}, Part{{a, at[1], b}}, Part{{c, b, at[2]}}, Part{{b, c, a}}};
  }
};

std::vector<Part> parts_of(int level) {
  std::vector<Part> parts;
  for (int i = 0; i < level; ++i) {
    for (int j = 0; i + j < level; ++j) {
      const auto at = [&](int x, int y) { return Vec2(real(x) / level, real(y) / level); };
      parts.push_back({{at(i, j), at(i + 1, j), at(i, j + 1)}});
      if (i + j + 1 < level) {
        parts.push_back({{at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}});
      }
    }
  }
  return parts;
}

/// Smallest and largest of n.x over the corners of a part.
std::array<double, 2> extent(const SurfaceFace& face, const PatchMap& map, const Part& part, const Vec3& n) {
  std::array<double, 2> range{infinity, -infinity};
  for (const Vec2& at : part.at) {
    const double value = n.dot(map.point(patch_weights(face, at)));
    range = {std::min(range[0], value), std::max(range[1], value)};
  }
  return range;
}

Vec2 middle(const Part& part) { return (part.at[0] + part.at[1] + part.at[2]) / 3; }

void add_block(BlockMatrix& matrix, Index row, Index column, const Matrix6& block) {
  const auto begin = matrix.column.begin() + narrow<std::ptrdiff_t>(matrix.row_start[row]);
  const auto end = matrix.column.begin() + narrow<std::ptrdiff_t>(matrix.row_start[row + 1]);
  const auto place = std::lower_bound(begin, end, column);
  if (place != end && *place == column) {  // else the pair came near within this step: the forces are there
    matrix.block(narrow<std::size_t>(place - matrix.column.begin())) += block;
  }
}

/// The paper's rule: the force goes to the corners by barycentric coordinates, and its part across the facet makes
/// moments there by the shape function, (C^-1)' w(x, y). Source: Comas, Duriez, Cotin 2010, section 2. Limits: the
/// moments are not in balance with the forces.
Vector18 paper_transfer(const PatchMap& map, const Vec2& at, const Vec3& force) {
  const Vec3 origin = map.points().col(0), e1 = map.points().col(1) - origin, e2 = map.points().col(2) - origin;
  const Vec3 x = e1.normalized(), z = e1.cross(e2).normalized(), y = z.cross(x);
  const PlaneTriangle triangle{e1.norm(), e2.dot(x), e2.dot(y)};
  const Vec3 flat = at[0] * e1 + at[1] * e2;
  const Vector9 values =
      inverse_shape_matrix(triangle).transpose() * (force.dot(z) * monomials(flat.dot(x), flat.dot(y)));
  const Vec3 shares(1 - at[0] - at[1], at[0], at[1]);
  Vector18 on_nodes;
  for (int k = 0; k < 3; ++k) {
    on_nodes.segment<3>(6 * k) = shares[k] * force;
    on_nodes.segment<3>(6 * k + 3) = values[3 * k + 1] * x + values[3 * k + 2] * y;  // by dw/dy and -dw/dx
  }
  return on_nodes;
}

/// What the samples of a face do to one other face.
struct Other {
  PatchMap::Points forces = PatchMap::Points::Zero();
  PatchMap::Matrix27 own = PatchMap::Matrix27::Zero();
  PatchMap::Matrix27 between = PatchMap::Matrix27::Zero();  ///< rows: of the face that is sampled
};

void add_other(const SurfaceFace& face, const SurfaceFace& other, const PatchMap& map, const PatchMap& its_map,
               const Other& act, VectorX& external, BlockMatrix* tangent) {
  const Vector18 on_nodes = its_map.to_nodes(act.forces);
  for (int k = 0; k < 3; ++k) {
    external.segment<6>(first_freedom(other.nodes[k])) += on_nodes.segment<6>(6 * k);
  }
  if (tangent == nullptr) {
    return;
  }
  PatchMap::Matrix27 backwards;
  for (int k = 0; k < 9; ++k) {
    for (int l = 0; l < 9; ++l) {
      backwards.block<3, 3>(3 * l, 3 * k) = act.between.block<3, 3>(3 * k, 3 * l);
    }
  }
  const Matrix18 own = its_map.stiffness(act.own, -act.forces);
  const Matrix18 there = map.jacobian().transpose() * (act.between * its_map.jacobian());
  const Matrix18 back = its_map.jacobian().transpose() * (backwards * map.jacobian());
  for (int k = 0; k < 3; ++k) {
    for (int l = 0; l < 3; ++l) {
      add_block(*tangent, face.nodes[k], other.nodes[l], there.block<6, 6>(6 * k, 6 * l));
      add_block(*tangent, other.nodes[k], face.nodes[l], back.block<6, 6>(6 * k, 6 * l));
      add_block(*tangent, other.nodes[k], other.nodes[l], own.block<6, 6>(6 * k, 6 * l));
    }
  }
}

}  // namespace

/// The faces in a configuration, each made when it is asked for.
class ContactSystem::Maps {
public:
  Maps(const Surfaces& surfaces, const std::vector<Vec3>& reference, const Configuration& configuration)
      : surfaces_(surfaces), reference_(reference), configuration_(configuration), maps_(surfaces.faces.size()) {}

  [[nodiscard]] PatchMap& operator[](std::size_t face) const {
    if (!maps_[face]) {
      maps_[face] = std::make_unique<PatchMap>(surfaces_.faces[face], reference_, configuration_);
      linear_.resize(maps_.size(), false);
    }
    return *maps_[face];
  }
  [[nodiscard]] const Bounds& bounds(std::size_t face) const {
    prepare(face);
    return bounds_[face]->first;
  }
  /// How far the surface may be from its flat facet, mm.
  [[nodiscard]] double bend(std::size_t face) const {
    prepare(face);
    return bounds_[face]->second;
  }
  /// Makes map and bounds: what is prepared may be asked for in parallel.
  void prepare(std::size_t face) const {
    if (bounds_.empty()) {
      bounds_.resize(maps_.size());
    }
    if (!bounds_[face]) {
      const SurfaceFace& of = surfaces_.faces[face];
      const PatchMap& map = (*this)[face];
      bounds_[face] = {bounds_of(of, map), of.curved ? flatness(patch_of(of, map), 1) : 0.0};
    }
  }
  [[nodiscard]] PatchMap& linearised(std::size_t face) const {
    PatchMap& map = (*this)[face];
    if (!linear_[face]) {
      map.linearise();
      linear_[face] = true;
    }
    return map;
  }

private:
  const Surfaces& surfaces_;
  const std::vector<Vec3>& reference_;
  const Configuration& configuration_;
  mutable std::vector<std::unique_ptr<PatchMap>> maps_;
  mutable std::vector<bool> linear_;
  mutable std::vector<std::optional<std::pair<Bounds, double>>> bounds_;
};

ContactSystem::ContactSystem(const Model& model, Surfaces surfaces, std::vector<Vec3> reference)
    : surfaces_(std::move(surfaces)), reference_(std::move(reference)), contacts_(model.contacts) {
  for (const RigidBody& body : model.rigids) {
    shapes_.emplace_back(body);
  }
  shapes_before_ = shapes_end_ = shapes_;
  accepted_ = {std::vector<Vec3>(reference_.size(), Vec3::Zero()),
               std::vector<Eigen::Quaterniond>(reference_.size(), Eigen::Quaterniond::Identity())};
  for (const Contact& contact : contacts_) {
    for (const ContactParty& party : contact.between) {
      for (std::size_t f = 0; !contact.curved && !party.rigid && f < surfaces_.faces.size(); ++f) {
        SurfaceFace& face = surfaces_.faces[f];
        face.curved = face.curved && face.body != party.index;
      }
    }
  }
  make_groups();
  const Maps maps(surfaces_, reference_, accepted_);
  refine(maps);
  const auto near = near_faces(maps, 0);
  double deepest = 0;
  std::size_t which = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (group.other.rigid ? !is_near(group, maps[group.face]) : near[g].empty()) {
      continue;
    }
    for (const Sample& sample : group.samples) {
      const double gap = touch(group, maps[group.face].point(sample.weights), near[g], maps).gap;
      if (gap <= deepest) {
        deepest = gap;
        which = group.contact + 1;
      }
    }
  }
  if (which > 0) {
    const Contact& contact = contacts_[which - 1];
    const auto name = [&](const ContactParty& party) {
      return party.rigid ? model.rigids[party.index].name : model.name_of(party.index);
    };
    throw InputError(
        fmt::format("{}{} and {} overlap by {:.4g} mm in the reference (walls have thickness): move them apart",
                    contact.said_at.empty() ? "" : contact.said_at + ": ", name(contact.between[0]),
                    name(contact.between[1]), -deepest));
  }
  accept(accepted_);
}

void ContactSystem::make_groups() {
  const auto wall_of = [&](std::size_t body) {
    double wall = 0;
    std::size_t count = 0;
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      const SurfaceFace& face = surfaces_.faces[f];
      wall += face.half_thickness > 0 ? 2 * face.half_thickness
                                      : (reference_[face.nodes[1]] - reference_[face.nodes[0]]).norm();
      ++count;
    }
    return wall / real(std::max<std::size_t>(1, count));
  };
  const auto young_of = [&](std::size_t body) { return surfaces_.faces[surfaces_.first[body]].young; };
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    const bool both = !contact.between[0].rigid && !contact.between[1].rigid;
    const bool self = both && contact.between[0].index == contact.between[1].index;
    double young = infinity;
    for (const ContactParty& party : contact.between) {
      young = party.rigid ? young : std::min(young, young_of(party.index));
    }
    young_.push_back(young);
    stiffness_.push_back(first_stiffness * young);
    mean_pressure_.push_back(0);
    for (std::size_t side = 0; side < (self ? 1 : 2); ++side) {
      const ContactParty& own = contact.between[side];
      const ContactParty& other = contact.between[1 - side];
      if (own.rigid) {
        continue;
      }
      const double wall = both ? std::min(wall_of(own.index), wall_of(other.index)) : wall_of(own.index);
      for (std::size_t f = surfaces_.first[own.index]; f < surfaces_.first[own.index + 1]; ++f) {
        const SurfaceFace& face = surfaces_.faces[f];
        Group group;
        group.face = f;
        group.contact = c;
        group.other = other;
        group.weight = both ? 0.5 : 1;
        group.resolution =
            contact.resolution * (face.half_thickness > 0 ? std::min(wall, 2 * face.half_thickness) : wall);
        group.elastic_slip = elastic_slip_of_wall * wall;
        groups_.push_back(std::move(group));
      }
    }
  }
}

void ContactSystem::sample(Group& group, int level) const {
  const SurfaceFace& face = surfaces_.faces[group.face];
  const Configuration rest{std::vector<Vec3>(reference_.size(), Vec3::Zero()),
                           std::vector<Eigen::Quaterniond>(reference_.size(), Eigen::Quaterniond::Identity())};
  const PatchMap map(face, reference_, rest);
  const std::vector<Sample> old = std::move(group.samples);
  group.level = level;
  group.samples.clear();
  for (const Part& part : parts_of(level)) {
    Sample sample;
    sample.at = middle(part);
    sample.weights = patch_weights(face, sample.at);
    const auto along = patch_weight_derivatives(face, sample.at);
    sample.area = map.point(along[0]).cross(map.point(along[1])).norm() / (2 * level * level);
    if (contacts_[group.contact].friction > 0 && !old.empty()) {  // it goes on with the slip of the nearest
      const auto nearest = std::min_element(old.begin(), old.end(), [&](const Sample& a, const Sample& b) {
        return (a.at - sample.at).squaredNorm() < (b.at - sample.at).squaredNorm();
      });
      sample.slip = nearest->slip;
      sample.followed = nearest->followed;
      sample.before = PatchMap(face, reference_, accepted_).point(sample.weights);
    }
    group.samples.push_back(sample);
  }
}

void ContactSystem::refine(const Maps& maps) {
  for (Group& group : groups_) {
    const SurfaceFace& face = surfaces_.faces[group.face];
    const PatchMap& map = maps[group.face];
    double longest = 0;
    for (int k = 0; k < 3; ++k) {
      longest = std::max(longest, (map.points().col((k + 1) % 3) - map.points().col(k)).norm());
    }
    // What the farthest point of a part bends away from the plane at its middle, with one piece per edge.
    double bend = face.curved ? flatness(patch_of(face, map), 1) : 0;
    if (group.other.rigid) {
      bend += longest * longest / 6 * shapes_[group.other.index].largest_curvature();
    } else {
      bend *= 2;
    }
    const double wanted = std::sqrt(bend / (sag_of_resolution * group.resolution));
    const auto level = narrow<int>(std::lround(std::clamp(std::ceil(wanted), real(least_level), real(most_level))));
    if (group.samples.empty() || level > group.level) {
      sample(group, level);
    }
    group.sag = bend / (group.level * group.level);
  }
}

double ContactSystem::wanted_stiffness(std::size_t c) const {
  return std::max(stiffness_of_pressure * mean_pressure_[c], least_stiffness * young_[c]);
}

bool ContactSystem::sharpen() {
  bool changed = false;
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    if (smallest_gap_[c] <= 0) {
      stiffness_[c] *= hardening;
      changed = true;
    } else if (mean_pressure_[c] > 0 && stiffness_[c] > blunt * mean_pressure_[c]) {
      changed = changed || wanted_stiffness(c) < stiffness_[c];
      stiffness_[c] = std::min(stiffness_[c], wanted_stiffness(c));
    }
  }
  return changed;
}

double ContactSystem::offset(const Group& group, std::size_t other) const {
  const SurfaceFace& own = surfaces_.faces[group.face];
  if (group.other.rigid) {
    return own.half_thickness;
  }
  const SurfaceFace& face = surfaces_.faces[other];
  const double walls = own.half_thickness + face.half_thickness;
  if (own.body != face.body) {
    return walls;
  }
  // Parts of one body may lie nearer than their walls are thick: along a fold of a thick shell.
  double nearest = infinity;
  for (const Index i : own.nodes) {
    const Vec3 p = closest_point_on_triangle(reference_[i], reference_[face.nodes[0]], reference_[face.nodes[1]],
                                             reference_[face.nodes[2]]);
    nearest = std::min(nearest, (p - reference_[i]).norm());
  }
  for (const Index i : face.nodes) {
    const Vec3 p = closest_point_on_triangle(reference_[i], reference_[own.nodes[0]], reference_[own.nodes[1]],
                                             reference_[own.nodes[2]]);
    nearest = std::min(nearest, (p - reference_[i]).norm());
  }
  return std::min(walls, own_distance * nearest - group.resolution);
}

double ContactSystem::deepest(const Group& group, std::size_t other) const {
  if (group.other.rigid) {
    return offset(group, 0) + shapes_[group.other.index].deepest();
  }
  const double walls = largest_overlap * offset(group, other);
  return walls > 0 ? walls : group.resolution / (4 * contacts_[group.contact].resolution);
}

bool ContactSystem::excluded(const Group& group, std::size_t other) const {
  const auto& a = surfaces_.faces[group.face].nodes;
  const auto& b = surfaces_.faces[other].nodes;
  if (std::any_of(a.begin(), a.end(), [&](Index i) { return std::find(b.begin(), b.end(), i) != b.end(); })) {
    return true;
  }
  return surfaces_.faces[group.face].body == surfaces_.faces[other].body && offset(group, other) <= 0;
}

std::vector<std::vector<std::size_t>> ContactSystem::near_faces(const Maps& maps, double more) const {
  std::vector<std::vector<std::size_t>> near(groups_.size());
  std::map<std::size_t, std::vector<std::size_t>> sorted;  // faces of a body, by their lower x
  std::vector<Bounds> bounds(surfaces_.faces.size());
  std::map<std::size_t, double> widest;
  const auto prepare = [&](std::size_t body) {
    auto& faces = sorted[body];
    if (!faces.empty()) {
      return;
    }
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      bounds[f] = maps.bounds(f);
      widest[body] = std::max(widest[body], bounds[f].upper.x() - bounds[f].lower.x());
      faces.push_back(f);
    }
    std::sort(faces.begin(), faces.end(), [&](std::size_t a, std::size_t b) {
      return std::pair(bounds[a].lower.x(), a) < std::pair(bounds[b].lower.x(), b);
    });
  };
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (group.other.rigid) {
      continue;
    }
    prepare(group.other.index);
    prepare(surfaces_.faces[group.face].body);
    const auto& faces = sorted[group.other.index];
    const Bounds& own = bounds[group.face];
    const double reach = group.resolution + surfaces_.faces[group.face].half_thickness +
                         surfaces_.faces[surfaces_.first[group.other.index]].half_thickness + more;
    auto place = std::lower_bound(faces.begin(), faces.end(), own.lower.x() - reach - widest[group.other.index],
                                  [&](std::size_t f, double x) { return bounds[f].lower.x() < x; });
    for (; place != faces.end() && bounds[*place].lower.x() <= own.upper.x() + reach; ++place) {
      if (own.meets(bounds[*place], reach) && !excluded(group, *place)) {
        near[g].push_back(*place);
      }
    }
  }
  return near;
}

bool ContactSystem::is_near(const Group& group, const PatchMap& map) const {
  const Bounds bounds = bounds_of(surfaces_.faces[group.face], map);
  const Vec3 centre = (bounds.lower + bounds.upper) / 2;
  const double radius = (bounds.upper - centre).norm();
  return shapes_[group.other.index].at(centre).distance - radius < group.resolution + offset(group, 0);
}

ContactSystem::Touch ContactSystem::touch(const Group& group, const Vec3& x, const std::vector<std::size_t>& near,
                                          const Maps& maps) const {
  Touch result;
  if (group.other.rigid) {
    const RigidDistance distance = shapes_[group.other.index].at(x);
    result.gap = distance.distance - offset(group, 0) - group.sag;
    result.normal = distance.normal;
    result.curvature = distance.curvature;
    return result;
  }
  for (const std::size_t f : near) {
    const SurfaceFace& face = surfaces_.faces[f];
    const PatchMap& map = maps[f];
    const Bounds& bounds = maps.bounds(f);
    const double off = offset(group, f) + group.sag;
    const double beyond = (bounds.lower - x).cwiseMax(x - bounds.upper).cwiseMax(0.0).norm();
    if (beyond - off >= std::min(result.gap, group.resolution)) {
      continue;
    }
    const Vec3 a = map.points().col(0), b = map.points().col(1), c = map.points().col(2);
    const Vec3 flat = closest_point_on_triangle(x, a, b, c);
    if ((x - flat).norm() - maps.bend(f) - off >= std::min(result.gap, group.resolution)) {
      continue;
    }
    const Vec3 e1 = b - a, e2 = c - a, d = flat - a;
    const double d11 = e1.dot(e1), d12 = e1.dot(e2), d22 = e2.dot(e2), r1 = d.dot(e1), r2 = d.dot(e2);
    const double det = d11 * d22 - d12 * d12;
    Vec2 at((d22 * r1 - d12 * r2) / det, (d11 * r2 - d12 * r1) / det);
    at = at.cwiseMax(0.0);
    if (at.sum() > 1) {
      at /= at.sum();
    }
    if (face.curved) {
      at = nearest_on_face(face, map, x, at);
    }
    const PatchWeights weights = patch_weights(face, at);
    const Vec3 away = x - map.point(weights);
    const double length = away.norm();
    double sign = 1;
    if (face.half_thickness == 0) {  // the surface of a solid has an inside
      sign = away.dot(e1.cross(e2)) >= 0 ? 1 : -1;
    }
    const double gap = sign * length - off;
    if (gap < result.gap && length > 0) {
      result.gap = gap;
      result.normal = sign / length * away;
      result.face = f;
      result.weights = weights;
      result.at = at;
    }
  }
  return result;
}

void ContactSystem::set_step(double from, double to, const Configuration& configuration) {
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    stiffness_[c] = mean_pressure_[c] > 0 ? wanted_stiffness(c) : first_stiffness * young_[c];
  }
  refine(Maps(surfaces_, reference_, configuration));
  begin_ = from;
  end_ = to;
  for (RigidShape& shape : shapes_end_) {
    shape.set_time(to);
  }
  set_left(1);
  bool moves = false;
  for (std::size_t r = 0; r < shapes_.size(); ++r) {
    moves = moves || shapes_[r].moves_to(shapes_end_[r]);
  }
  set_left(moves ? 1 : 0);
  for (Group& group : groups_) {
    for (Sample& sample : group.samples) {
      sample.pressure = -1;
      sample.active = false;
    }
  }
}

void ContactSystem::set_left(double left) {
  left_ = left;
  for (RigidShape& shape : shapes_) {
    shape.set_time(left == 0 ? end_ : end_ - left * (end_ - begin_));
  }
}

bool ContactSystem::find_pairs(const Configuration& configuration) {
  if (std::all_of(groups_.begin(), groups_.end(), [](const Group& group) { return group.other.rigid; })) {
    return false;
  }
  double edges = 0;
  for (const SurfaceFace& face : surfaces_.faces) {
    edges += (reference_[face.nodes[1]] - reference_[face.nodes[0]]).norm() / real(surfaces_.faces.size());
  }
  const Maps maps(surfaces_, reference_, configuration);
  const auto near = near_faces(maps, edges / 2);
  std::set<std::array<Index, 2>> all(pairs_.begin(), pairs_.end());
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    for (const std::size_t f : near[g]) {
      for (const Index i : surfaces_.faces[groups_[g].face].nodes) {
        for (const Index j : surfaces_.faces[f].nodes) {
          all.insert({std::min(i, j), std::max(i, j)});
        }
      }
    }
  }
  if (all.size() == pairs_.size()) {
    return false;
  }
  pairs_.assign(all.begin(), all.end());
  return true;
}

Vec3 ContactSystem::relative_motion(const Group& group, const Sample& sample, const Touch& touch, const Vec3& x) const {
  if (!sample.followed) {
    return Vec3::Zero();
  }
  if (group.other.rigid) {
    const Vec3 there = shapes_[group.other.index].carried(sample.before, shapes_before_[group.other.index]);
    return x - there;
  }
  // The point of the other surface that is touched now has come from its place in the last accepted state.
  const SurfaceFace& face = surfaces_.faces[touch.face];
  const Vec3 before = PatchMap(face, reference_, accepted_).point(touch.weights);
  return (x - sample.before) - (x - touch.normal * (touch.gap + group.sag + offset(group, touch.face)) - before);
}

std::vector<std::vector<ContactSystem::Touch>> ContactSystem::all_touches(
    const Maps& maps, const std::vector<std::vector<std::size_t>>& near) const {
  std::vector<std::vector<Touch>> touches(groups_.size());
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (group.other.rigid ? !is_near(group, maps[group.face]) : near[g].empty()) {
      continue;
    }
    touches[g].resize(group.samples.size());
    maps.prepare(group.face);
    for (const std::size_t f : near[g]) {
      maps.prepare(f);
    }
  }
  parallel_for_blocks(groups_.size(), groups_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      for (std::size_t i = 0; i < touches[g].size(); ++i) {
        const Group& group = groups_[g];
        touches[g][i] = touch(group, maps[group.face].point(group.samples[i].weights), near[g], maps);
      }
    }
  });
  return touches;
}

bool ContactSystem::add(const Configuration& configuration, VectorX& external, BlockMatrix* tangent) {
  const Maps maps(surfaces_, reference_, configuration);
  const auto near = near_faces(maps, 0);
  const auto touches = all_touches(maps, near);
  std::vector<double> pressed(contacts_.size(), 0), squared(contacts_.size(), 0);
  smallest_gap_.assign(contacts_.size(), infinity);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    const Contact& contact = contacts_[group.contact];
    const double barrier = stiffness_[group.contact];
    if (tangent != nullptr) {
      for (Sample& sample : group.samples) {
        sample.active = false;
      }
    }
    if (touches[g].empty()) {
      continue;
    }
    const SurfaceFace& face = surfaces_.faces[group.face];
    PatchMap::Points forces = PatchMap::Points::Zero();
    PatchMap::Points on_samples = PatchMap::Points::Zero();  // without what the rest of a motion adds
    PatchMap::Matrix27 stiffness = PatchMap::Matrix27::Zero();
    std::map<std::size_t, Other> others;
    Vector18 by_the_paper = Vector18::Zero();
    bool any = false;
    for (std::size_t i = 0; i < group.samples.size(); ++i) {
      Sample& sample = group.samples[i];
      const Touch& t = touches[g][i];
      if (t.gap >= group.resolution) {
        continue;
      }
      if (t.gap < -deepest(group, t.face)) {
        return false;
      }
      const Vec3 x = maps[group.face].point(sample.weights);
      any = true;
      smallest_gap_[group.contact] = std::min(smallest_gap_[group.contact], t.gap);
      const double s = std::max(t.gap / group.resolution, straight_below);
      const double straight = barrier * (1 / (s * s) - 1);  // the derivative there
      const double law = barrier * (1 - s) * (1 - s) / s + (s - t.gap / group.resolution) * straight;
      const double area = group.weight * sample.area;
      pressed[group.contact] += area * law;
      squared[group.contact] += area * law * law;
      const Vec3& n = t.normal;
      const Mat3 across = Mat3::Identity() - n * n.transpose();
      Vec3 slip = Vec3::Zero();
      double slip_length = 0;
      Vec3 traction = law * n;
      if (contact.friction > 0) {
        slip = across * (sample.slip + relative_motion(group, sample, t, x));
        slip_length = std::max(slip.norm(), group.elastic_slip);
        traction -= contact.friction * law / slip_length * slip;
      }
      const Vec3 force = area * traction;
      const double expected =
          sample.pressure < 0 ? law : std::clamp(sample.pressure, law / largest_expectation, law * largest_expectation);
      // The derivative of the law on its straight part; else that of p g = const (1 - g / d)^2 at the pressure
      // expected.
      const double slope = t.gap < straight_below * group.resolution ? straight / group.resolution
                                                                     : (expected + 2 * barrier * (1 - s)) / t.gap;
      if (record_ != nullptr) {
        ContactResult& result = (*record_)[group.contact];
        const bool on_first = !contact.between[0].rigid && contact.between[0].index == face.body;
        const double sign = on_first ? 1 : -1;
        result.force += sign * force;
        result.moment += sign * x.cross(force);
        const auto along = patch_weight_derivatives(face, sample.at);
        const PatchMap& own = maps[group.face];
        result.area +=
            group.weight * own.point(along[0]).cross(own.point(along[1])).norm() / (2 * group.level * group.level);
        ++result.points;
        if (slip.norm() > group.elastic_slip) {
          result.slip = std::max(result.slip, slip.norm() - group.elastic_slip);
        }
        if (group.other.rigid) {
          on_rigids_[group.other.index][0] -= force;
          on_rigids_[group.other.index][1] -= x.cross(force);
        }
      }
      on_samples += force * sample.weights.transpose();
      Mat3 derivative = slope * n * n.transpose() - law * t.curvature;  // of minus the traction by x
      if (contact.friction > 0) {
        const Vec3 direction = slip / slip_length;
        Mat3 of_slip = across;
        if (slip.norm() > group.elastic_slip) {
          of_slip -= direction * direction.transpose();
        }
        derivative += contact.friction * (expected / slip_length * of_slip - slope * direction * n.transpose());
      }
      Vec3 all = force;
      if (tangent != nullptr) {
        sample.active = true;
        sample.law = law;
        sample.slope = slope;
        sample.normal = n;
        sample.other = t.face;
        sample.other_weights = t.weights;
        if (left_ > 0 && group.other.rigid) {
          // The body's point that is touched goes on: as if the surface moved back by that.
          const RigidShape& now = shapes_[group.other.index];
          const RigidShape& then = shapes_end_[group.other.index];
          const double closes = then.at(x).distance - now.at(x).distance;
          const Vec3 moved = then.carried(x, now) - x;
          all -= area * derivative * (closes * n - across * moved);
        }
        for (int k = 0; k < 9; ++k) {
          for (int l = 0; l < 9; ++l) {
            const double w = area * sample.weights[k] * sample.weights[l];
            if (w != 0) {
              stiffness.block<3, 3>(3 * k, 3 * l) += w * derivative;
            }
          }
        }
      }
      forces += all * sample.weights.transpose();
      if (!contact.consistent) {
        by_the_paper += paper_transfer(maps[group.face], sample.at, all);
      }
      if (t.face != SIZE_MAX) {
        Other& other = others[t.face];
        other.forces -= force * t.weights.transpose();
        for (int k = 0; tangent != nullptr && k < 9; ++k) {
          for (int l = 0; l < 9; ++l) {
            const double theirs = area * t.weights[k] * t.weights[l];
            const double ours = area * sample.weights[k] * t.weights[l];
            if (theirs != 0) {
              other.own.block<3, 3>(3 * k, 3 * l) += theirs * derivative;
            }
            if (ours != 0) {
              other.between.block<3, 3>(3 * k, 3 * l) -= ours * derivative;
            }
          }
        }
      }
    }
    if (!any) {
      continue;
    }
    PatchMap& map = maps.linearised(group.face);
    const Vector18 on_nodes = contact.consistent ? map.to_nodes(forces) : by_the_paper;
    for (int k = 0; k < 3; ++k) {
      external.segment<6>(first_freedom(face.nodes[k])) += on_nodes.segment<6>(6 * k);
    }
    if (tangent != nullptr) {
      const Matrix18 of_nodes = map.stiffness(stiffness, -on_samples);
      for (int k = 0; k < 3; ++k) {
        for (int l = 0; l < 3; ++l) {
          add_block(*tangent, face.nodes[k], face.nodes[l], of_nodes.block<6, 6>(6 * k, 6 * l));
        }
      }
    }
    for (const auto& [number, other] : others) {
      add_other(face, surfaces_.faces[number], map, maps.linearised(number), other, external, tangent);
    }
  }
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    mean_pressure_[c] = pressed[c] > 0 ? squared[c] / pressed[c] : 0;
  }
  if (tangent != nullptr) {
    at_tangent_ = configuration;
    shapes_at_tangent_ = shapes_;
  }
  return true;
}

void ContactSystem::predict(const VectorX& increment) {
  const Maps maps(surfaces_, reference_, at_tangent_);
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
      if (!own) {
        own = change_of(group.face);
      }
      Vec3 moved = *own * sample.weights;
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

void ContactSystem::accept(const Configuration& configuration) {
  const Maps maps(surfaces_, reference_, configuration);
  const auto near = near_faces(maps, 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    const bool friction = contacts_[group.contact].friction > 0;
    const bool is_close = group.other.rigid ? is_near(group, maps[group.face]) : !near[g].empty();
    for (Sample& sample : group.samples) {
      if (!friction || !is_close) {
        sample.followed = false;
        sample.slip.setZero();
        continue;
      }
      const Vec3 x = maps[group.face].point(sample.weights);
      const Touch t = touch(group, x, near[g], maps);
      if (t.gap < group.resolution) {
        Vec3 slip = sample.slip + relative_motion(group, sample, t, x);
        slip -= t.normal * t.normal.dot(slip);
        sample.slip = slip * std::min(1.0, group.elastic_slip / std::max(slip.norm(), group.elastic_slip));
      } else {
        sample.slip.setZero();
      }
      sample.before = x;
      sample.followed = true;
    }
  }
  accepted_ = configuration;
  shapes_before_ = shapes_;
}

bool ContactSystem::is_certain(const Configuration& configuration) const {
  if (std::any_of(smallest_gap_.begin(), smallest_gap_.end(), [](double gap) { return gap <= 0; })) {
    return false;
  }
  const Maps before(surfaces_, reference_, accepted_);
  const Maps now(surfaces_, reference_, configuration);
  // Whatever comes near on the way is near at one end within what moves.
  double farthest = 0;
  for (std::size_t i = 0; i < reference_.size(); ++i) {
    farthest = std::max(farthest, (configuration.displacement[i] - accepted_.displacement[i]).norm());
  }
  const auto near = near_faces(now, 2 * farthest);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if ((groups_[g].other.rigid || !near[g].empty()) && !is_certain(groups_[g], near[g], before, now)) {
      return false;
    }
  }
  return true;
}

bool ContactSystem::is_certain(const Group& group, const std::vector<std::size_t>& near, const Maps& before,
                               const Maps& now) const {
  const SurfaceFace& face = surfaces_.faces[group.face];
  const PatchMap &a0 = before[group.face], &a1 = now[group.face];
  const auto bend_of = [](const SurfaceFace& f, const PatchMap& map, int level) {
    return f.curved ? flatness(patch_of(f, map), level) : 0.0;
  };
  if (group.other.rigid) {
    const RigidShape &s0 = shapes_before_[group.other.index], &s1 = shapes_[group.other.index];
    const auto far = [&](const PatchMap& m0, const PatchMap& m1, const Vec3& c0, const Vec3& c1, double reach) {
      // Distances change no faster than what moves.
      double motion = 0;
      for (int k = 0; k < (face.curved ? 9 : 3); ++k) {
        motion = std::max(motion, (m1.points().col(k) - s1.carried(m0.points().col(k), s0)).norm());
      }
      motion += s1.growth_since(s0);
      return s0.at(c0).distance + s1.at(c1).distance - 2 * reach > motion;
    };
    {
      const Bounds b0 = bounds_of(face, a0), b1 = bounds_of(face, a1);
      const double reach = std::max((b0.upper - b0.lower).norm(), (b1.upper - b1.lower).norm()) / 2;
      if (far(a0, a1, (b0.lower + b0.upper) / 2, (b1.lower + b1.upper) / 2, reach)) {
        return true;
      }
    }
    const std::function<bool(const Part&, int)> certain = [&](const Part& part, int level) {
      const PatchWeights weights = patch_weights(face, middle(part));
      const Vec3 c0 = a0.point(weights), c1 = a1.point(weights);
      const double bend0 = bend_of(face, a0, level), bend1 = bend_of(face, a1, level);
      for (const Vec3& n : {s1.at(c1).normal, s0.at(c0).normal}) {
        if (s0.convex() && extent(face, a0, part, n)[0] - bend0 > s0.support(n) &&
            extent(face, a1, part, n)[0] - bend1 > s1.support(n)) {
          return true;
        }
      }
      double reach = 0;
      for (const Vec2& at : part.at) {
        reach = std::max({reach, (a0.point(patch_weights(face, at)) - c0).norm() + bend0,
                          (a1.point(patch_weights(face, at)) - c1).norm() + bend1});
      }
      if (far(a0, a1, c0, c1, reach)) {
        return true;
      }
      const auto smaller = part.split();
      return level < group.level << most_refined &&
             std::all_of(smaller.begin(), smaller.end(), [&](const Part& p) { return certain(p, 2 * level); });
    };
    const auto parts = parts_of(group.level);
    return std::all_of(parts.begin(), parts.end(), [&](const Part& part) { return certain(part, group.level); });
  }
  for (const std::size_t f : near) {
    const SurfaceFace& other = surfaces_.faces[f];
    const PatchMap &b0 = before[f], &b1 = now[f];
    const std::function<bool(const Part&, const Part&, int, int)> certain = [&](const Part& p, const Part& q, int level,
                                                                                int depth) {
      const double bend0 = bend_of(face, a0, level) + bend_of(other, b0, level);
      const double bend1 = bend_of(face, a1, level) + bend_of(other, b1, level);
      const auto between = [&](const PatchMap& a, const PatchMap& b) {
        return Vec3(a.point(patch_weights(face, middle(p))) - b.point(patch_weights(other, middle(q)))).normalized();
      };
      const auto normal = [&](const SurfaceFace& of, const PatchMap& map, const Part& part) {
        const auto along = patch_weight_derivatives(of, middle(part));
        return Vec3(map.point(along[0]).cross(map.point(along[1])).normalized());
      };
      for (const Vec3& n : {between(a1, b1), between(a0, b0), normal(other, b1, q), Vec3(-normal(other, b1, q)),
                            normal(face, a1, p), Vec3(-normal(face, a1, p))}) {
        if (extent(face, a0, p, n)[0] - extent(other, b0, q, n)[1] > bend0 &&
            extent(face, a1, p, n)[0] - extent(other, b1, q, n)[1] > bend1) {
          return true;
        }
      }
      if (depth == most_refined) {
        return false;
      }
      for (const Part& a : p.split()) {
        for (const Part& b : q.split()) {
          if (!certain(a, b, 2 * level, depth + 1)) {
            return false;
          }
        }
      }
      return true;
    };
    const Part whole{{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}};
    if (!certain(whole, whole, 1, 0)) {
      return false;
    }
  }
  return true;
}

double ContactSystem::lower_gap(const Group& group, const std::vector<std::size_t>& near, const Maps& maps,
                                double upper) const {
  const SurfaceFace& face = surfaces_.faces[group.face];
  const PatchMap& a = maps[group.face];
  const auto bend_of = [](const SurfaceFace& f, const PatchMap& map, int level) {
    return f.curved ? flatness(patch_of(f, map), level) : 0.0;
  };
  double lower = upper;
  // A part is split while its bound could be the smallest and lies more than this below what was sampled.
  const double close = 0.5 * upper;
  if (group.other.rigid) {
    const RigidShape& shape = shapes_[group.other.index];
    const std::function<void(const Part&, int)> visit = [&](const Part& part, int level) {
      const Vec3 c = a.point(patch_weights(face, middle(part)));
      const RigidDistance at = shape.at(c);
      const double bend = bend_of(face, a, level);
      double bound = 0;
      if (shape.convex()) {  // the tangent of a convex function lies below it
        bound = at.distance + extent(face, a, part, at.normal)[0] - at.normal.dot(c) - bend;
      } else {
        double reach = 0;
        for (const Vec2& b : part.at) {
          reach = std::max(reach, (a.point(patch_weights(face, b)) - c).norm());
        }
        bound = at.distance - reach - bend;
      }
      bound -= offset(group, 0);
      if (bound >= lower) {
        return;
      }
      if (bound > upper - close || level >= group.level << most_refined) {
        lower = bound;
        return;
      }
      for (const Part& smaller : part.split()) {
        visit(smaller, 2 * level);
      }
    };
    for (const Part& part : parts_of(group.level)) {
      visit(part, group.level);
    }
    return lower;
  }
  for (const std::size_t f : near) {
    const SurfaceFace& other = surfaces_.faces[f];
    const PatchMap& b = maps[f];
    const double walls = offset(group, f);
    const std::function<void(const Part&, const Part&, int)> visit = [&](const Part& p, const Part& q, int level) {
      const double bend = bend_of(face, a, level) + bend_of(other, b, level);
      const Vec3 away = a.point(patch_weights(face, middle(p))) - b.point(patch_weights(other, middle(q)));
      const auto along = patch_weight_derivatives(other, middle(q));
      const Vec3 normal = b.point(along[0]).cross(b.point(along[1])).normalized();
      double bound = -infinity;
      for (const Vec3& n : {Vec3(away.normalized()), Vec3(normal.dot(away) >= 0 ? normal : Vec3(-normal))}) {
        bound = std::max(bound, extent(face, a, p, n)[0] - extent(other, b, q, n)[1] - bend - walls);
      }
      if (bound >= lower) {
        return;
      }
      if (bound > upper - close || level >= 1 << (2 + most_refined)) {
        lower = bound;
        return;
      }
      for (const Part& smaller : p.split()) {
        for (const Part& theirs : q.split()) {
          visit(smaller, theirs, 2 * level);
        }
      }
    };
    const Part whole{{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}};
    visit(whole, whole, 1);
  }
  return lower;
}

std::vector<ContactResult> ContactSystem::results(const Configuration& configuration) {
  std::vector<ContactResult> results(contacts_.size());
  on_rigids_.assign(shapes_.size(), {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()});
  VectorX nodal = VectorX::Zero(first_freedom(reference_.size()));
  record_ = &results;
  (void)add(configuration, nodal, nullptr);
  record_ = nullptr;
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
    on_rigids_[r][2] = shapes_[r].position();
    force += on_rigids_[r][0];
    moment += on_rigids_[r][1];
  }
  imbalance_ = {forces > 0 ? force.norm() / forces : 0, moments > 0 ? moment.norm() / moments : 0};
  const Maps maps(surfaces_, reference_, configuration);
  const auto near = near_faces(maps, 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (group.other.rigid ? !is_near(group, maps[group.face]) : near[g].empty()) {
      continue;
    }
    ContactResult& result = results[group.contact];
    double upper = infinity;
    for (const Sample& sample : group.samples) {
      upper = std::min(upper, touch(group, maps[group.face].point(sample.weights), near[g], maps).gap + group.sag);
    }
    result.gap_upper = std::min(result.gap_upper, upper);
    result.gap_lower = std::min(result.gap_lower, lower_gap(group, near[g], maps, upper));
  }
  return results;
}

std::vector<double> ContactSystem::memory() const {
  std::vector<double> values;
  for (const Group& group : groups_) {
    for (const Sample& sample : group.samples) {
      values.push_back(sample.followed ? 1 : 0);
      values.insert(values.end(), sample.slip.begin(), sample.slip.end());
    }
  }
  return values;
}

void ContactSystem::recall(const std::vector<double>& memory, const Configuration& configuration, double time) {
  set_step(time, time, configuration);
  accept(configuration);
  std::size_t next = 0;
  for (Group& group : groups_) {
    for (Sample& sample : group.samples) {
      TUNICA_ASSERT(next + 4 <= memory.size());
      sample.followed = memory[next] != 0;
      sample.slip = Vec3(memory[next + 1], memory[next + 2], memory[next + 3]);
      next += 4;
    }
  }
}

}  // namespace tunica
