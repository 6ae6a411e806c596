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

/// Part of both half walls up to which shells may overlap on the way.
constexpr double largest_overlap = 0.8;
constexpr double elastic_slip_of_wall = 1e-3;  // slip at which friction is fully there
constexpr double sag_of_resolution = 0.05;     // what a surface may bend between samples
constexpr double straight_above = 1e-3;        // sine between the way to a surface and its normal
constexpr int least_level = 4, most_level = 32;

/// However small a rigid body is, between samples it moves away by no more than they are apart.
double bend_of_rigid(double curvature, double longest) { return std::min(longest * longest / 6 * curvature, longest); }

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
  accepted_ = maps_at(rest_);
  make_sides(model);
  refine(*accepted_);
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

void ContactSystem::make_sides(const Model& model) {
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
  const auto density_of = [&](std::size_t body) {
    const Material& material =
        model.is_solid(body) ? model.solids[body - model.shells.size()].material : model.shells[body].material;
    return material.density.value_or(0);
  };
  std::map<std::size_t, double> walls;  // of the bodies that deform
  // Mass that a touch has to stop, per area. Of a solid 6 volume / area is the height of a cube or a ball; four times
  // as much, for an edge that strikes stops what stands beside it, too (Impacts.ABlock*).
  const auto mass_of = [&](std::size_t body) {
    double volume = 0, area = 0;
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      const auto& [a, b, c] = surfaces_.faces[f].nodes;
      const Vec3 twice = (reference_[b] - reference_[a]).cross(reference_[c] - reference_[a]);
      volume += reference_[a].dot(twice) / 6;
      area += twice.norm() / 2;
    }
    return density_of(body) * (model.is_solid(body) ? 24 * volume / area : walls[body]);
  };
  for (const Contact& contact : contacts_) {
    for (const ContactParty& party : contact.between) {
      if (!party.rigid && walls.emplace(party.index, 0).second) {
        walls[party.index] = wall_of(party.index);
        std::vector<std::size_t> faces(surfaces_.first[party.index + 1] - surfaces_.first[party.index]);
        std::iota(faces.begin(), faces.end(), surfaces_.first[party.index]);
        std::vector<Bounds> boxes(surfaces_.faces.size());
        for (const std::size_t f : faces) {
          boxes[f] = accepted_->bounds(f);
          thickest_[party.index] = std::max(thickest_[party.index], surfaces_.faces[f].half_thickness);
        }
        trees_.emplace(party.index, std::make_shared<BoxTree>(std::move(faces), boxes));
      }
    }
  }
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    const bool both = !contact.between[0].rigid && !contact.between[1].rigid;
    const bool self = both && contact.between[0].index == contact.between[1].index;
    double young = infinity, wall = infinity, mass = 0;
    for (const ContactParty& party : contact.between) {
      young = party.rigid ? young : std::min(young, young_of(party.index));
      wall = party.rigid ? wall : std::min(wall, walls[party.index]);
      mass = party.rigid ? mass : std::max(mass, mass_of(party.index));
    }
    barriers_.emplace_back(young, mass, contact.resolution * wall);
    for (std::size_t k = 0; k < (self ? 1 : 2); ++k) {
      const ContactParty &own = contact.between[k], &other = contact.between[1 - k];
      if (own.rigid && shapes_[own.index].convex()) {
        continue;
      }
      const bool one = !own.rigid && other.rigid && shapes_[other.index].convex();
      sides_.push_back({c, own.index, other, own.rigid, one ? 1 : 0.5, wall});
      if (own.rigid) {
        add_points(sides_.size() - 1);
        continue;
      }
      std::vector<Group> groups;
      for (std::size_t f = surfaces_.first[own.index]; f < surfaces_.first[own.index + 1]; ++f) {
        Group group = group_of_face(sides_.size() - 1, f);
        resolution_ = std::min(resolution_, group.resolution);
        if (!other.rigid) {
          groups.push_back(std::move(group));
        }
      }
      add_groups(std::move(groups));
    }
  }
}

ContactSystem::Group ContactSystem::group_of(std::size_t number, double wall) const {
  const Side& side = sides_[number];
  Group group;
  group.side = number;
  group.contact = side.contact;
  group.other = side.other;
  group.weight = side.weight;
  group.wall = wall;
  group.resolution = contacts_[side.contact].resolution * wall;
  group.elastic_slip = elastic_slip_of_wall * side.wall;
  return group;
}

ContactSystem::Group ContactSystem::group_of_face(std::size_t side, std::size_t f) const {
  const double mean = sides_[side].wall, own = 2 * surfaces_.faces[f].half_thickness;
  Group group = group_of(side, own > 0 ? std::min(mean, own) : mean);
  group.face = f;
  return group;
}

void ContactSystem::add_points(std::size_t number) {
  constexpr double spacing_of_edge = 0.25;
  const Side& side = sides_[number];
  double edges = 0;
  for (std::size_t f = surfaces_.first[side.other.index]; f < surfaces_.first[side.other.index + 1]; ++f) {
    edges += (reference_[surfaces_.faces[f].nodes[1]] - reference_[surfaces_.faces[f].nodes[0]]).norm();
  }
  const double mean =
      edges / real(std::max<std::size_t>(1, surfaces_.first[side.other.index + 1] - surfaces_.first[side.other.index]));
  const double spacing = spacing_of_edge * mean;
  for (const Vec3& point : shapes_[side.body].corners_and_edges(spacing)) {
    Group group = group_of(number, side.wall);
    group.point = point;
    group.rigid = side.body;
    group.level = 1;
    group.samples.emplace_back();
    group.samples.back().weights.setZero();
    group.samples.back().at.setZero();
    group.samples.back().area = spacing * spacing;
    resolution_ = std::min(resolution_, group.resolution);
    groups_.push_back(std::move(group));
  }
}

void ContactSystem::add_groups(std::vector<Group> more) {
  if (more.empty()) {
    return;
  }
  const auto before = [](const Group& a, const Group& b) {
    return std::pair(a.side, a.face) < std::pair(b.side, b.face);
  };
  const auto middle = narrow<std::ptrdiff_t>(groups_.size());
  std::ranges::move(more, std::back_inserter(groups_));
  std::inplace_merge(groups_.begin(), groups_.begin() + middle, groups_.end(), before);
}

void ContactSystem::gather(const FaceMaps& maps) {
  std::vector<Group> more;
  auto known = groups_.begin();
  for (std::size_t number = 0; number < sides_.size(); ++number) {
    const Side& side = sides_[number];
    if (side.points || !side.other.rigid) {
      continue;
    }
    known = std::find_if(known, groups_.end(), [&](const Group& group) { return group.side >= number; });
    const RigidShape& shape = shapes_[side.other.index];
    const double resolution = contacts_[side.contact].resolution * side.wall;
    // Of any of its groups, by refine().
    const double sag = std::max(sag_of_resolution * resolution, side.largest_bend / (most_level * most_level));
    const double reach = resolution + sag + thickest_.at(side.body);
    std::vector<std::size_t> faces;
    trees_.at(side.body)->find_if(
        [&](const Bounds& box) {
          const Vec3 centre = (box.lower + box.upper) / 2;
          return shape.at(centre).distance - (box.upper - centre).norm() < reach;
        },
        faces);
    for (const std::size_t f : faces) {
      while (known != groups_.end() && known->side == number && known->face < f) {
        ++known;
      }
      if (known != groups_.end() && known->side == number && known->face == f) {
        continue;
      }
      Group group = group_of_face(number, f);
      refine(group);
      if (is_near(group, maps)) {
        more.push_back(std::move(group));
      }
    }
  }
  add_groups(std::move(more));
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
  bends_.assign(surfaces_.faces.size(), {0, 0});
  std::map<std::size_t, std::array<double, 2>> largest;
  for (const auto& [body, tree] : trees_) {
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      const PatchMap& map = maps[f];
      auto& [bend, longest] = bends_[f];
      // What the farthest point of a part bends away from the plane at its middle, with one piece per edge.
      bend = surfaces_.faces[f].curved ? flatness(patch_of(surfaces_.faces[f], map), 1) : 0;
      for (int k = 0; k < 3; ++k) {
        longest = std::max(longest, (map.points().col((k + 1) % 3) - map.points().col(k)).norm());
      }
      largest[body] = {std::max(largest[body][0], bend), std::max(largest[body][1], longest)};
    }
  }
  for (Side& side : sides_) {
    if (!side.points && side.other.rigid) {
      side.curvature = shapes_[side.other.index].largest_curvature();
      const auto [bend, longest] = largest[side.body];
      side.largest_bend = bend + bend_of_rigid(side.curvature, longest);
    }
  }
  for (Group& group : groups_) {
    refine(group);
  }
}

void ContactSystem::refine(Group& group) const {
  if (group.point) {
    return;
  }
  const auto [own, longest] = bends_[group.face];
  const double bend = group.other.rigid ? own + bend_of_rigid(sides_[group.side].curvature, longest) : 2 * own;
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

void ContactSystem::brace(const std::vector<double>& speeds, double length) {
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    double speed = 0;
    for (const ContactParty& party : contacts_[c].between) {
      speed += party.rigid
                   ? (shapes_end_[party.index].position() - shapes_before_[party.index].position()).norm() / length
                   : speeds[party.index];
    }
    barriers_[c].brace(speed);
  }
}

bool ContactSystem::harden() {
  bool changed = false;
  for (Barrier& barrier : barriers_) {
    changed = barrier.harden() || changed;
  }
  return changed;
}

bool ContactSystem::sharpen() {
  bool changed = false;
  for (Barrier& barrier : barriers_) {
    changed = barrier.sharpen() || changed;
  }
  return changed;
}

double ContactSystem::potential() const {
  double sum = 0;
  for (const Barrier& barrier : barriers_) {
    sum += barrier.potential();
  }
  return sum;
}

double ContactSystem::accepted_potential() const {
  double sum = 0;
  for (const Barrier& barrier : barriers_) {
    sum += barrier.accepted().potential;
  }
  return sum;
}

std::vector<double> ContactSystem::pressed() const {
  std::vector<double> pressed;
  for (const Barrier& barrier : barriers_) {
    pressed.push_back(barrier.accepted().pressed);
  }
  return pressed;
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

std::vector<std::vector<std::size_t>> ContactSystem::near_faces(const FaceMaps& maps, double more) {
  constexpr std::size_t groups_per_task = 256;
  std::vector<Bounds> bounds(surfaces_.faces.size());
  for (auto& [body, tree] : trees_) {
    for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
      bounds[f] = maps.bounds(f);
    }
    tree->refit(bounds);
  }
  gather(maps);
  std::vector<std::vector<std::size_t>> near(groups_.size());
  parallel_for_blocks(groups_.size(), groups_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      const Group& group = groups_[g];
      if (group.other.rigid) {
        continue;
      }
      const double thick = thickest_.at(group.other.index);
      const Vec3 point = group.point ? shapes_[group.rigid].of_mesh(*group.point) : Vec3(Vec3::Zero());
      const Bounds own = group.point ? Bounds{point, point} : bounds[group.face];
      const double walls = (group.point ? 0 : surfaces_.faces[group.face].half_thickness) + thick;
      const double reach = std::max(group.resolution, thick == 0 ? group.wall / 4 : 0) + group.sag + walls + more;
      trees_.at(group.other.index)->find(own, reach, near[g]);
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
  std::ranges::for_each(barriers_, &Barrier::go_back);
  std::ranges::for_each(groups_, let_sleep);
  std::erase_if(groups_, [](const Group& group) { return group.other.rigid && group.samples.empty(); });
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
  is_driven_ = moves;
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
  if (std::ranges::all_of(sides_, [](const Side& side) { return side.other.rigid || side.points; })) {
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
  for (Barrier& barrier : barriers_) {
    hardening_ += barrier.accept();
  }
}

void ContactSystem::go_back() {
  shapes_ = shapes_before_;
  std::ranges::for_each(barriers_, &Barrier::go_back);
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
  std::vector<double> values;
  for (const Barrier& barrier : barriers_) {
    const auto& [stiffness, least, potential, pressed, part] = barrier.accepted();
    values.insert(values.end(), {stiffness, least, potential, pressed, part});
  }
  values.push_back(real(pairs_.size()));
  for (const auto& [i, j] : pairs_) {
    values.insert(values.end(), {real(i), real(j)});
  }
  const auto comes_and_goes = [](const Group& group) { return group.other.rigid; };
  values.push_back(real(narrow<std::size_t>(std::ranges::count_if(groups_, comes_and_goes))));
  for (const Group& group : groups_ | std::views::filter(comes_and_goes)) {
    values.insert(values.end(), {real(group.side), real(group.face)});
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
  for (Barrier& barrier : barriers_) {
    Barrier::Memory accepted;
    for (double* kept :
         {&accepted.stiffness, &accepted.least, &accepted.potential, &accepted.pressed, &accepted.part}) {
      *kept = next();
    }
    barrier.recall(accepted);
  }
  hardening_ = 0;
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
  std::erase_if(groups_, [](const Group& group) { return group.other.rigid; });
  std::vector<Group> near(truncated<std::size_t>(next()));
  for (Group& group : near) {
    const auto side = truncated<std::size_t>(next());
    const auto face = truncated<std::size_t>(next());
    if (side >= sides_.size() || sides_[side].points || face >= surfaces_.faces.size() ||
        surfaces_.faces[face].body != sides_[side].body) {
      throw InputError("what contact remembers is of another model");
    }
    group = group_of_face(side, face);
  }
  add_groups(std::move(near));
  refine(*accepted_);
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
