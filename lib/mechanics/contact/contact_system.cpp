#include "tunica/core/error.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/contact/detail/box_tree.hpp"
#include "tunica/mechanics/contact/detail/own_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <ranges>
#include <set>
#include <utility>

namespace tunica {
namespace {

constexpr double first_stiffness = 1e-5;  // of the barrier, of Young's modulus, while no pressure is known
constexpr double least_stiffness = 1e-8;  // of the barrier, of Young's modulus: where a contact opens
/// Barrier's stiffness over the largest pressure that takes just that part of the resolution below which the law is
/// straight.
constexpr double stiffness_of_pressure =
    ContactSystem::straight_below / ((1 - ContactSystem::straight_below) * (1 - ContactSystem::straight_below));
constexpr double blunt = 2;               // of what is wanted: above, the barrier is made softer
constexpr double largest_hardening = 10;  // of the barrier at a time: pressures of iterates may be far too large
/// Part of both half walls up to which shells may overlap on the way.
constexpr double largest_overlap = 0.8;
constexpr double elastic_slip_of_wall = 1e-3;  // slip at which friction is fully there
constexpr double sag_of_resolution = 0.05;     // what a surface may bend between samples
constexpr double straight_above = 1e-3;        // sine between the way to a surface and its normal
constexpr int least_level = 4, most_level = 32;

}  // namespace

ContactSystem::ContactSystem(const Model& model, Surfaces surfaces, std::vector<Vec3> reference,
                             const std::vector<Carried>& carried)
    : surfaces_(std::move(surfaces)),
      reference_(std::move(reference)),
      contacts_(model.contacts),
      rest_(Configuration::at_rest(reference_.size())) {
  for (const RigidBody& body : model.rigids) {
    shapes_.emplace_back(body);
  }
  for (const Carried& c : carried) {
    std::size_t body = 0;
    while (body + 1 < model.body_count() && model.first_node(body + 1) <= c.carriers.front()) {
      ++body;
    }
    carrier_[c.node] = body;
  }
  shapes_before_ = shapes_end_ = shapes_;
  for (const Contact& contact : contacts_) {
    for (const ContactParty& party : contact.between) {
      for (std::size_t f = 0; !contact.curved && !party.rigid && f < surfaces_.faces.size(); ++f) {
        SurfaceFace& face = surfaces_.faces[f];
        face.curved = face.curved && face.body != party.index;
      }
    }
  }
  const auto name = [&](const ContactParty& party) {
    return party.rigid ? model.rigids[party.index].name : model.name_of(party.index);
  };
  for (const auto& [one, other] : contacts_ | std::views::transform(&Contact::between)) {
    const bool self = !one.rigid && !other.rigid && one.index == other.index;
    if (self) {
      number_parts(model, one.index, surfaces_);
    }
    meetings_.push_back(fmt::format("{} meets {}", name(one), self ? "itself" : name(other)));
  }
  make_groups();
  accepted_ = maps_at(rest_);
  const FaceMaps& maps = *accepted_;
  refine(maps);
  require_apart(model);
  accept(rest_);
}

/// Most states are asked for several times: by Newton's method, certificates and results.
std::shared_ptr<const FaceMaps> ContactSystem::maps_at(const Configuration& configuration) {
  for (const auto& known : {last_, accepted_, at_tangent_}) {
    if (known && known->are_at(configuration)) {
      return known;
    }
  }
  last_ = std::make_shared<const FaceMaps>(surfaces_, reference_, configuration);
  return last_;
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
    largest_pressure_.push_back(0);
    pressed_.push_back(0);
    for (std::size_t side = 0; side < (self ? 1 : 2); ++side) {
      const ContactParty& own = contact.between[side];
      const ContactParty& other = contact.between[1 - side];
      if (own.rigid) {
        if (!shapes_[own.index].convex()) {
          add_points(contact, c, side, wall_of(other.index));
        }
        continue;
      }
      const double wall = both ? std::min(wall_of(own.index), wall_of(other.index)) : wall_of(own.index);
      for (std::size_t f = surfaces_.first[own.index]; f < surfaces_.first[own.index + 1]; ++f) {
        const SurfaceFace& face = surfaces_.faces[f];
        Group group;
        group.face = f;
        group.contact = c;
        group.other = other;
        group.weight = both || !shapes_[other.index].convex() ? 0.5 : 1;
        group.wall = face.half_thickness > 0 ? std::min(wall, 2 * face.half_thickness) : wall;
        group.resolution = contact.resolution * group.wall;
        group.elastic_slip = elastic_slip_of_wall * wall;
        groups_.push_back(std::move(group));
      }
    }
  }
}

void ContactSystem::add_points(const Contact& contact, std::size_t number, std::size_t side, double wall) {
  constexpr double spacing_of_edge = 0.25;
  const ContactParty& other = contact.between[1 - side];
  const std::size_t rigid = contact.between[side].index;
  double edges = 0;
  for (std::size_t f = surfaces_.first[other.index]; f < surfaces_.first[other.index + 1]; ++f) {
    edges += (reference_[surfaces_.faces[f].nodes[1]] - reference_[surfaces_.faces[f].nodes[0]]).norm();
  }
  const double mean =
      edges / real(std::max<std::size_t>(1, surfaces_.first[other.index + 1] - surfaces_.first[other.index]));
  const double spacing = spacing_of_edge * mean;
  for (const Vec3& point : shapes_[rigid].corners_and_edges(spacing)) {
    Group group;
    group.point = point;
    group.rigid = rigid;
    group.contact = number;
    group.other = other;
    group.weight = 0.5;
    group.wall = wall;
    group.resolution = contact.resolution * wall;
    group.elastic_slip = elastic_slip_of_wall * wall;
    group.level = 1;
    group.samples.emplace_back();
    group.samples.back().weights.setZero();
    group.samples.back().at.setZero();
    group.samples.back().area = spacing * spacing;
    groups_.push_back(std::move(group));
  }
}

Vec3 ContactSystem::place(const Group& group, const Sample& sample, const FaceMaps& maps) const {
  return group.point ? shapes_[group.rigid].of_mesh(*group.point) : maps[group.face].point(sample.weights);
}

bool ContactSystem::is_close(const Group& group, const std::vector<std::size_t>& near, const FaceMaps& maps) const {
  return group.other.rigid ? is_near(group, maps) : !near.empty();
}

void ContactSystem::wake(Group& group) const {
  if (group.samples.empty()) {
    sample(group, group.level);
  }
}

void ContactSystem::let_sleep(Group& group) {
  if (!group.point && !group.close && !group.samples.empty() && !group.samples.front().followed) {
    std::vector<Sample>().swap(group.samples);
  }
}

void ContactSystem::sample(Group& group, int level) const {
  if (group.point) {
    return;
  }
  const SurfaceFace& face = surfaces_.faces[group.face];
  const PatchMap map(face, reference_, rest_);
  const std::vector<Sample> old = std::move(group.samples);
  group.level = level;
  group.samples.clear();
  for (int i = 0; i <= level; ++i) {
    for (int j = 0; i + j <= level; ++j) {
      group.samples.push_back(sample_at(group, map, i, j));
    }
  }
  if (contacts_[group.contact].friction == 0 || old.empty()) {
    return;
  }
  for (Sample& sample : group.samples) {  // it goes on with the slip of the nearest
    const auto nearest = std::min_element(old.begin(), old.end(), [&](const Sample& a, const Sample& b) {
      return (a.at - sample.at).squaredNorm() < (b.at - sample.at).squaredNorm();
    });
    sample.slip = nearest->slip;
    sample.slipped = nearest->slipped;
    sample.followed = nearest->followed;
    sample.before = (*accepted_)[group.face].point(sample.weights);
  }
}

ContactSystem::Sample ContactSystem::sample_at(const Group& group, const PatchMap& map, int i, int j) const {
  // A third of each part that meets at the point.
  const int level = group.level;
  const int sides = (i == 0 ? 1 : 0) + (j == 0 ? 1 : 0) + (i + j == level ? 1 : 0);
  const int parts = sides == 0 ? 6 : sides == 1 ? 3 : 1;
  Sample sample;
  sample.at = Vec2(real(i) / level, real(j) / level);
  sample.share = parts / (6.0 * level * level);
  sample.weights = patch_weights(surfaces_.faces[group.face], sample.at);
  const auto along = patch_weight_derivatives(surfaces_.faces[group.face], sample.at);
  sample.area = sample.share * map.point(along[0]).cross(map.point(along[1])).norm();
  return sample;
}

void ContactSystem::refine(const FaceMaps& maps) {
  for (Group& group : groups_) {
    if (group.point) {
      continue;
    }
    const SurfaceFace& face = surfaces_.faces[group.face];
    const PatchMap& map = maps[group.face];
    double longest = 0;
    for (int k = 0; k < 3; ++k) {
      longest = std::max(longest, (map.points().col((k + 1) % 3) - map.points().col(k)).norm());
    }
    // What the farthest point of a part bends away from the plane at its middle, with one piece per edge.
    double bend = face.curved ? flatness(patch_of(face, map), 1) : 0;
    if (group.other.rigid) {
      // However small a body is, between samples it moves away by no more than they are apart.
      bend += std::min(longest * longest / 6 * shapes_[group.other.index].largest_curvature(), longest);
    } else {
      bend *= 2;
    }
    const double wanted = std::sqrt(bend / (sag_of_resolution * group.resolution));
    const auto level = narrow<int>(std::lround(std::clamp(std::ceil(wanted), real(least_level), real(most_level))));
    if (level > group.level) {
      group.level = level;
      if (!group.samples.empty()) {
        sample(group, level);
      }
    }
    group.sag = bend / (group.level * group.level);
  }
}

bool ContactSystem::harden() {
  bool changed = false;
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    if (smallest_gap_[c] <= 0) {
      stiffness_[c] = std::min(stiffness_of_pressure * largest_pressure_[c], largest_hardening * stiffness_[c]);
      changed = true;
    }
  }
  return changed;
}

bool ContactSystem::sharpen() {
  bool changed = harden();
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const double wanted = std::max(stiffness_of_pressure * largest_pressure_[c], least_stiffness * young_[c]);
    if (largest_pressure_[c] > 0 && stiffness_[c] > blunt * wanted) {
      stiffness_[c] = wanted;
      changed = true;
    }
  }
  return changed;
}

double ContactSystem::offset(const Group& group, std::size_t other) const {
  if (group.point) {
    return surfaces_.faces[other].half_thickness;
  }
  const SurfaceFace& own = surfaces_.faces[group.face];
  if (group.other.rigid) {
    return own.half_thickness;
  }
  const SurfaceFace& face = surfaces_.faces[other];
  const double walls = own.half_thickness + face.half_thickness;
  if (!hang_together(own, face)) {
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
  return walls > 0 ? walls : group.wall / 4;
}

bool ContactSystem::excluded(const Group& group, std::size_t other) const {
  if (group.point) {
    return false;
  }
  const SurfaceFace &own = surfaces_.faces[group.face], &its = surfaces_.faces[other];
  return share_a_node(own, its) || (hang_together(own, its) && offset(group, other) <= 0) ||
         is_carried(own, its.body) || is_carried(its, own.body);
}

bool ContactSystem::is_carried(const SurfaceFace& face, std::size_t body) const {
  return std::any_of(face.nodes.begin(), face.nodes.end(), [&](Index i) {
    const auto found = carrier_.find(i);
    return found != carrier_.end() && found->second == body;
  });
}

std::vector<std::vector<std::size_t>> ContactSystem::near_faces(const FaceMaps& maps, double more) const {
  constexpr std::size_t groups_per_task = 256;
  std::vector<std::vector<std::size_t>> near(groups_.size());
  std::map<std::size_t, BoxTree> trees;  // of a body
  std::vector<Bounds> bounds(surfaces_.faces.size());
  std::map<std::size_t, double> thickest;  // half walls
  std::set<std::size_t> prepared;
  const auto prepare = [&](std::size_t body) {
    for (std::size_t f = surfaces_.first[body]; prepared.count(body) == 0 && f < surfaces_.first[body + 1]; ++f) {
      bounds[f] = maps.bounds(f);
      thickest[body] = std::max(thickest[body], surfaces_.faces[f].half_thickness);
    }
    prepared.insert(body);
  };
  for (const Group& group : groups_) {
    if (group.other.rigid) {
      continue;
    }
    prepare(group.other.index);
    if (!group.point) {
      prepare(surfaces_.faces[group.face].body);
    }
    if (trees.count(group.other.index) == 0) {
      std::vector<std::size_t> faces(surfaces_.first[group.other.index + 1] - surfaces_.first[group.other.index]);
      std::iota(faces.begin(), faces.end(), surfaces_.first[group.other.index]);
      trees.emplace(group.other.index, BoxTree(std::move(faces), bounds));
    }
  }
  parallel_for_blocks(groups_.size(), groups_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      const Group& group = groups_[g];
      if (group.other.rigid) {
        continue;
      }
      const double thick = thickest.at(group.other.index);
      const Vec3 point = group.point ? shapes_[group.rigid].of_mesh(*group.point) : Vec3(Vec3::Zero());
      const Bounds own = group.point ? Bounds{point, point} : bounds[group.face];
      const double walls = (group.point ? 0 : surfaces_.faces[group.face].half_thickness) + thick;
      const double reach = std::max(group.resolution, thick == 0 ? group.wall / 4 : 0) + group.sag + walls + more;
      trees.at(group.other.index).find(own, reach, near[g]);
      std::erase_if(near[g], [&](std::size_t f) { return excluded(group, f); });
    }
  });
  return near;
}

bool ContactSystem::is_near(const Group& group, const FaceMaps& maps) const {
  const Bounds& bounds = maps.bounds(group.face);
  const Vec3 centre = (bounds.lower + bounds.upper) / 2;
  const double radius = (bounds.upper - centre).norm();
  return shapes_[group.other.index].at(centre).distance - radius < group.resolution + group.sag + offset(group, 0);
}

ContactSystem::Touch ContactSystem::touch(const Group& group, const Vec3& x, const std::vector<std::size_t>& near,
                                          const FaceMaps& maps) const {
  Touch result;
  if (group.other.rigid) {
    const RigidDistance distance = shapes_[group.other.index].at(x);
    result.gap = distance.distance - offset(group, 0) - group.sag;
    result.normal = distance.normal;
    result.curvature = distance.curvature;
    return result;
  }
  // The nearest counts, also from inside a solid; of faces that share their nearest point the one that faces it, or
  // where they touch the one that faces the sample's own.
  const Vec3 own = group.point ? Vec3(Vec3::Zero()) : facet_normal(maps[group.face]);
  double nearest = infinity, facing = 0;
  for (const std::size_t f : near) {
    const SurfaceFace& face = surfaces_.faces[f];
    const PatchMap& map = maps[f];
    const Bounds& bounds = maps.bounds(f);
    const bool has_inside = face.half_thickness == 0;
    const double off = offset(group, f) + group.sag;
    const double tie = has_inside ? same_distance * group.wall : 0;
    const double most =
        std::min(nearest + tie, has_inside ? std::max(group.resolution, deepest(group, f)) : group.resolution);
    const double beyond = (bounds.lower - x).cwiseMax(x - bounds.upper).cwiseMax(0.0).norm();
    if (beyond - off >= most) {
      continue;
    }
    const Vec3 a = map.points().col(0), b = map.points().col(1), c = map.points().col(2);
    const Vec3 flat = closest_point_on_triangle(x, a, b, c);
    if ((x - flat).norm() - maps.bend(f) - off >= most) {
      continue;
    }
    Vec2 at = barycentric(flat, a, b, c).tail<2>();
    if (face.curved) {
      at = nearest_on_face(face, map, x, at);
    }
    const PatchWeights weights = patch_weights(face, at);
    const Vec3 away = x - map.point(weights);
    const double length = away.norm();
    Vec3 outward = Vec3::Zero();
    double up = 0;
    if (has_inside) {
      outward = facet_normal(map);
      up = length > tie ? outward.dot(away) : -group.wall * outward.dot(own);
    }
    if (length - off >= most || (length - off > nearest - tie && std::abs(up) <= facing)) {
      continue;
    }
    const bool touches = length <= tie || length == 0;
    const double sign = up < 0 && !touches ? -1 : 1;
    nearest = length - off;
    facing = std::abs(up);
    result.gap = sign * length - off;
    result.normal = touches ? outward : Vec3(sign / length * away);
    result.face = f;
    result.at = at;
    result.weights = weights;
    const auto along = patch_weight_derivatives(face, at);
    const Vec3 normal = map.point(along[0]).cross(map.point(along[1])).normalized();
    result.on_face = normal.cross(away).norm() <= straight_above * length;
  }
  return result;
}

void ContactSystem::set_step(double from, double to, const Configuration& configuration) {
  stiffness_ = accepted_stiffness_;
  std::ranges::for_each(groups_, let_sleep);
  refine(*maps_at(configuration));
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
  if (std::all_of(groups_.begin(), groups_.end(),
                  [](const Group& group) { return group.other.rigid || group.point; })) {
    return false;
  }
  double edges = 0;
  for (const SurfaceFace& face : surfaces_.faces) {
    edges += (reference_[face.nodes[1]] - reference_[face.nodes[0]]).norm() / real(surfaces_.faces.size());
  }
  const auto near = near_faces(*maps_at(configuration), edges / 2);
  std::set<std::array<Index, 2>> all(pairs_.begin(), pairs_.end());
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    for (std::size_t n = 0; !groups_[g].point && n < near[g].size(); ++n) {
      const std::size_t f = near[g][n];
      for (const Index i : surfaces_.faces[groups_[g].face].nodes) {
        for (const Index j : surfaces_.faces[f].nodes) {
          all.insert({std::min(i, j), std::max(i, j)});
        }
      }
    }
  }
  if (all.size() != pairs_.size()) {
    pairs_.assign(all.begin(), all.end());
    pairs_are_new_ = true;
  }
  return std::exchange(pairs_are_new_, false);
}

void ContactSystem::accept(const Configuration& configuration) {
  if (std::any_of(contacts_.begin(), contacts_.end(), [](const Contact& c) { return c.friction > 0; })) {
    keep_slip(configuration);
  }
  accepted_ = maps_at(configuration);
  shapes_before_ = shapes_;
  accepted_stiffness_ = stiffness_;
  std::ranges::transform(pressed_, largest_pressure_, pressed_.begin(),
                         [](double a, double b) { return std::max(a, b); });
}

double ContactSystem::resolution() const {
  double smallest = infinity;
  for (const Group& group : groups_) {
    smallest = std::min(smallest, group.resolution);
  }
  return smallest;
}

void ContactSystem::go_back() {
  shapes_ = shapes_before_;
  stiffness_ = accepted_stiffness_;
  left_ = 0;
}

std::string ContactSystem::closest_place() const {
  if (!std::isfinite(closest_.gap)) {
    return "";
  }
  return fmt::format("; in contact {} they are closest at ({:.4g}, {:.4g}, {:.4g}) mm, where {}",
                     contacts_[closest_.contact].name, closest_.at.x(), closest_.at.y(), closest_.at.z(),
                     meetings_[closest_.contact]);
}

void ContactSystem::keep_slip(const Configuration& configuration) {
  const auto kept = maps_at(configuration);
  const FaceMaps& maps = *kept;
  const auto near = near_faces(maps, 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    if (contacts_[group.contact].friction == 0) {
      continue;
    }
    const bool close = is_close(group, near[g], maps);
    if (close) {
      wake(group);
    }
    for (Sample& sample : group.samples) {
      if (!close) {
        sample.followed = false;
        sample.slip.setZero();
        sample.slipped = 0;
        continue;
      }
      const Vec3 x = place(group, sample, maps);
      const Touch t = touch(group, x, near[g], maps);
      if (t.gap < group.resolution) {
        Vec3 slip = sample.slip + relative_motion(group, sample, t, x, maps);
        slip -= t.normal * t.normal.dot(slip);
        const double most = std::max(slip.norm(), group.elastic_slip);
        sample.slipped += most - group.elastic_slip;
        sample.slip = slip * (group.elastic_slip / most);
      } else {
        sample.slip.setZero();
        sample.slipped = 0;
      }
      sample.before = x;
      sample.followed = true;
    }
  }
}

std::vector<double> ContactSystem::memory() const {
  std::vector<double> values = accepted_stiffness_;
  values.insert(values.end(), pressed_.begin(), pressed_.end());
  values.push_back(real(pairs_.size()));
  for (const auto& [i, j] : pairs_) {
    values.insert(values.end(), {real(i), real(j)});
  }
  for (const Group& group : groups_) {
    values.insert(values.end(), {real(group.level), group.sag});
    const bool rubs = contacts_[group.contact].friction > 0;
    if (rubs) {
      values.push_back(real(group.samples.size()));
    }
    for (std::size_t i = 0; rubs && i < group.samples.size(); ++i) {
      const Sample& sample = group.samples[i];
      values.push_back(sample.followed ? 1 : 0);
      values.insert(values.end(), sample.slip.begin(), sample.slip.end());
      values.push_back(sample.slipped);
    }
  }
  return values;
}

void ContactSystem::recall(const std::vector<double>& memory, const Configuration& configuration, double time) {
  std::size_t read = 0;
  const auto next = [&] {
    if (read == memory.size()) {
      throw InputError("what contact remembers is of another model");
    }
    return memory[read++];
  };
  std::ranges::generate(accepted_stiffness_, next);
  stiffness_ = accepted_stiffness_;
  std::ranges::generate(pressed_, next);
  std::vector<std::array<Index, 2>> pairs(truncated<std::size_t>(next()));
  for (auto& [i, j] : pairs) {
    i = truncated<Index>(next());
    j = truncated<Index>(next());
  }
  pairs_are_new_ = pairs_are_new_ || pairs != pairs_;
  pairs_ = std::move(pairs);
  begin_ = end_ = time;
  left_ = 0;
  for (std::size_t r = 0; r < shapes_.size(); ++r) {
    shapes_[r].set_time(time);
    shapes_end_[r].set_time(time);
  }
  shapes_before_ = shapes_;
  accepted_ = maps_at(configuration);
  for (Group& group : groups_) {
    group.level = truncated<int>(next());
    group.sag = next();
    if (!group.point) {
      group.samples.clear();
    }
    if (contacts_[group.contact].friction > 0 && next() > 0) {
      wake(group);
    }
    for (std::size_t i = 0; contacts_[group.contact].friction > 0 && i < group.samples.size(); ++i) {
      Sample& sample = group.samples[i];
      sample.followed = next() != 0;
      sample.slip = Vec3::NullaryExpr([&] { return next(); });
      sample.slipped = next();
      sample.before = place(group, sample, *accepted_);
    }
  }
  if (read != memory.size()) {
    throw InputError("what contact remembers is of another model");
  }
}

}  // namespace tunica
