#include "tunica/core/error.hpp"
#include "tunica/mechanics/contact/detail/box_tree.hpp"
#include "tunica/mechanics/contact/detail/own_surface.hpp"
#include "tunica/surface/distance/signed_distance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace tunica {
namespace {

/// The surface of one body in the reference; of a solid it is closed.
/// @param left_out  a piece of it; SIZE_MAX: none
TriangleMesh surface_of(const Surfaces& surfaces, std::size_t body, const std::vector<Vec3>& reference,
                        std::size_t left_out) {
  TriangleMesh mesh{reference, {}};
  for (std::size_t f = surfaces.first[body]; f < surfaces.first[body + 1]; ++f) {
    if (surfaces.faces[f].part != left_out) {
      mesh.triangles.push_back(surfaces.faces[f].nodes);
    }
  }
  return mesh;
}

/// Of every body: whether it touches itself and is of several pieces.
std::vector<bool> of_several_parts(const Surfaces& surfaces) {
  std::vector<bool> several(surfaces.first.size() - 1);
  for (const SurfaceFace& face : surfaces.faces) {
    several[face.body] = several[face.body] || face.part != surfaces.faces[surfaces.first[face.body]].part;
  }
  return several;
}

struct Overlap {
  double depth = 0;
  std::size_t contact = SIZE_MAX;

  /// @param touching  what counts as none, mm
  void look(double gap, double touching, std::size_t at) {
    if (-gap > std::max(depth, touching)) {
      depth = -gap;
      contact = at;
    }
  }
};

/// Where a body passes through itself at a node that lies on faces of another part of it. Such parts are nought apart,
/// so that contact, which leaves what is near in the reference alone, does not see them.
class OwnCrossing {
public:
  OwnCrossing(const Surfaces& surfaces, std::size_t body, const std::vector<Vec3>& reference)
      : surfaces_(surfaces), reference_(reference) {
    std::vector<std::size_t> faces;
    std::vector<Bounds> boxes(surfaces.faces.size());
    for (std::size_t f = surfaces.first[body]; f < surfaces.first[body + 1]; ++f) {
      const auto [a, b, c] = corners(f);
      boxes[f] = {a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c)};
      faces.push_back(f);
      for (const Index node : surfaces.faces[f].nodes) {
        around_[node].push_back(f);
      }
      edge_ += (b - a).norm();
    }
    edge_ /= real(std::max<std::size_t>(1, faces.size()));
    tree_ = BoxTree(std::move(faces), boxes);
  }

  /// The first node, if any, whose neighbours lie on both sides of the faces that it lies on.
  [[nodiscard]] std::optional<Vec3> find() const {
    for (const auto& [node, own] : around_) {
      const std::vector<std::size_t> met = met_at(node, own);
      bool above = false, below = false;
      for (std::size_t k = 0; !met.empty() && k < 3 * own.size(); ++k) {
        const Vec3 way = reference_[surfaces_.faces[own[k / 3]].nodes[k % 3]] - reference_[node];
        const double side = way.isZero(0) ? 0 : side_of(reference_[node], way.normalized(), met);
        above = above || side > clear;
        below = below || side < -clear;
      }
      if (above && below) {
        return reference_[node];
      }
    }
    return std::nullopt;
  }

private:
  static constexpr double near = 1e-6;   // of the mean edge: files keep seven digits
  static constexpr double clear = 1e-3;  // sine between a way and a face
  static constexpr double step = 0.05;   // of the mean edge

  [[nodiscard]] std::array<Vec3, 3> corners(std::size_t f) const {
    const auto& nodes = surfaces_.faces[f].nodes;
    return {reference_[nodes[0]], reference_[nodes[1]], reference_[nodes[2]]};
  }

  /// The faces on which a node lies, but for those next to it.
  [[nodiscard]] std::vector<std::size_t> met_at(Index node, const std::vector<std::size_t>& own) const {
    const Vec3& x = reference_[node];
    std::vector<std::size_t> met;
    tree_.find({x, x}, near * edge_, met);
    std::erase_if(met, [&](std::size_t f) {
      const auto& nodes = surfaces_.faces[f].nodes;
      const auto [a, b, c] = corners(f);
      return (closest_point_on_triangle(x, a, b, c) - x).norm() > near * edge_ ||
             std::ranges::any_of(own, [&](std::size_t mine) {
               return std::ranges::find_first_of(surfaces_.faces[mine].nodes, nodes) !=
                      surfaces_.faces[mine].nodes.end();
             });
    });
    return met;
  }

  /// The sine by which a way from a point on faces leaves them, above zero towards their normals; 0 beside their rim.
  [[nodiscard]] double side_of(const Vec3& from, const Vec3& way, const std::vector<std::size_t>& met) const {
    const Vec3 p = from + step * edge_ * way;
    double nearest = infinity;
    for (const std::size_t f : met) {
      const auto [a, b, c] = corners(f);
      nearest = std::min(nearest, (p - closest_point_on_triangle(p, a, b, c)).norm());
    }
    std::size_t ties = 0;
    double side = 0;
    bool over_a_face = false;
    for (const std::size_t f : met) {
      const auto [a, b, c] = corners(f);
      const Vec3 off = p - closest_point_on_triangle(p, a, b, c);
      if (off.norm() > nearest + near * edge_) {
        continue;
      }
      ++ties;
      const double height = (b - a).cross(c - a).normalized().dot(off);
      over_a_face = over_a_face || std::abs(height) > (1 - near) * off.norm();
      side = std::abs(height) > std::abs(side) ? height : side;
    }
    return over_a_face || ties > 1 ? side / (step * edge_) : 0;
  }

  const Surfaces& surfaces_;
  const std::vector<Vec3>& reference_;
  std::map<Index, std::vector<std::size_t>> around_;  ///< the faces at each node
  double edge_ = 0;                                   ///< mm, mean
  BoxTree tree_;
};

}  // namespace

/// Of solids the distance of every sample from the whole surface counts, so that a body wholly inside is found.
void ContactSystem::require_apart(const Model& model) {
  require_no_own_crossing(model);
  const FaceMaps& maps = *accepted_;
  const auto near = near_faces(maps, 0);
  const std::vector<bool> several = of_several_parts(surfaces_);
  std::map<std::array<std::size_t, 2>, std::pair<SignedDistance, Bounds>> solids;
  const auto solid = [&](std::size_t body,
                         std::size_t left_out = SIZE_MAX) -> const std::pair<SignedDistance, Bounds>& {
    const auto found = solids.find({body, left_out});
    if (found != solids.end()) {
      return found->second;
    }
    const TriangleMesh mesh = surface_of(surfaces_, body, reference_, left_out);
    Bounds box{Vec3::Constant(infinity), Vec3::Constant(-infinity)};
    for (const auto& triangle : mesh.triangles) {
      for (const Index i : triangle) {
        box.lower = box.lower.cwiseMin(reference_[i]);
        box.upper = box.upper.cwiseMax(reference_[i]);
      }
    }
    return solids.emplace(std::array{body, left_out}, std::pair(SignedDistance(mesh), box)).first->second;
  };
  Overlap deepest;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Group& group = groups_[g];
    if (group.point && model.is_solid(group.other.index)) {
      deepest.look(solid(group.other.index).first.at(place(group, group.samples[0], maps)).distance,
                   same_distance * group.wall, group.contact);
      continue;
    }
    const SurfaceFace& face = surfaces_.faces[group.face];
    const bool self = !group.point && !group.other.rigid && group.other.index == face.body;
    const bool in_solid = !group.point && !group.other.rigid && model.is_solid(group.other.index) &&
                          (!self || several[face.body]) && !is_carried(face, group.other.index);
    if (in_solid) {
      const auto& [distance, box] = solid(group.other.index, self ? face.part : SIZE_MAX);
      if (!box.meets(maps.bounds(group.face), face.half_thickness)) {
        continue;
      }
      wake(group);
      for (const Sample& sample : group.samples) {
        const Vec3 x = maps[group.face].point(sample.weights);
        deepest.look(distance.at(x).distance - face.half_thickness, same_distance * group.wall, group.contact);
      }
    } else if (is_close(group, near[g], maps)) {
      wake(group);
      for (const Sample& sample : group.samples) {
        const double gap = touch(group, place(group, sample, maps), near[g], maps).gap + group.sag;
        deepest.look(gap, same_distance * group.wall, group.contact);
      }
    }
  }
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    for (std::size_t side = 0; side < 2; ++side) {
      const ContactParty &rigid = contacts_[c].between[side], &other = contacts_[c].between[1 - side];
      if (rigid.rigid && !other.rigid && model.is_solid(other.index)) {
        if (const auto inside = shapes_[rigid.index].inner_point()) {
          deepest.look(solid(other.index).first.at(*inside).distance, 0, c);
        }
      }
    }
  }
  if (deepest.contact == SIZE_MAX) {
    return;
  }
  const Contact& contact = contacts_[deepest.contact];
  const auto name = [&](const ContactParty& party) {
    return party.rigid ? model.rigids[party.index].name : model.name_of(party.index);
  };
  throw InputError(
      fmt::format("{}{} and {} overlap by {:.4g} mm in the reference (walls have thickness): move them apart",
                  contact.said_at.empty() ? "" : contact.said_at + ": ", name(contact.between[0]),
                  name(contact.between[1]), deepest.depth));
}

/// Contact leaves alone what is nearer than it can hold apart. Along a fold of the wall that is right: one whose faces
/// touch is half a circle across, its middle as wide as the wall is thick. Paths along edges are longer than those
/// across faces, by less than two times, and end at nodes.
std::optional<Vec3> ContactSystem::first_fold(const Model& model, std::size_t contact) const {
  const std::size_t body = contacts_[contact].between[0].index;
  if (model.is_solid(body)) {
    return std::nullopt;
  }
  const auto longest_side = [&](const SurfaceFace& face) {
    double longest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      longest = std::max(longest, (reference_[face.nodes[(k + 1) % 3]] - reference_[face.nodes[k]]).norm());
    }
    return longest;
  };
  std::vector<Bounds> boxes(surfaces_.faces.size());
  std::vector<std::size_t> faces;
  for (std::size_t f = surfaces_.first[body]; f < surfaces_.first[body + 1]; ++f) {
    boxes[f] = accepted_->bounds(f);
    faces.push_back(f);
  }
  const BoxTree tree(std::move(faces), boxes);
  const SurfacePaths paths(model, body);
  for (const Group& group : groups_) {
    if (group.contact != contact) {
      continue;
    }
    const SurfaceFace& own = surfaces_.faces[group.face];
    std::vector<std::size_t> near;
    tree.find(boxes[group.face], group.resolution / own_distance, near);
    for (const std::size_t f : near) {
      const SurfaceFace& other = surfaces_.faces[f];
      if (share_a_node(own, other) || !hang_together(own, other) || offset(group, f) > 0) {
        continue;
      }
      const double half_circle = std::numbers::pi / 2 * (own.half_thickness + other.half_thickness);
      if (!paths.connect(own, other, 2 * half_circle + longest_side(own) + longest_side(other))) {
        return (reference_[own.nodes[0]] + reference_[own.nodes[1]] + reference_[own.nodes[2]]) / 3;
      }
    }
  }
  return std::nullopt;
}

void ContactSystem::require_no_own_crossing(const Model& model) const {
  const std::vector<bool> several = of_several_parts(surfaces_);
  for (std::size_t c = 0; c < contacts_.size(); ++c) {
    const Contact& contact = contacts_[c];
    const auto& [a, b] = contact.between;
    if (a.rigid || b.rigid || a.index != b.index) {
      continue;
    }
    if (model.is_solid(a.index) && !several[a.index]) {
      throw InputError(fmt::format(
          "{}{} is a solid of one piece, whose parts contact does not hold apart: leave this contact out, or give what "
          "may meet as pieces that do not hang together",
          contact.said_at.empty() ? "" : contact.said_at + ": ", model.name_of(a.index)));
    }
    if (const auto at = OwnCrossing(surfaces_, a.index, reference_).find()) {
      throw InputError(fmt::format(
          "{}{} passes through itself in the reference at ({:.4g}, {:.4g}, {:.4g}) mm: move its parts "
          "apart, or mend the mesh",
          contact.said_at.empty() ? "" : contact.said_at + ": ", model.name_of(a.index), at->x(), at->y(), at->z()));
    }
    if (const auto at = first_fold(model, c)) {
      throw InputError(fmt::format(
          "{}parts of {} lie in each other in the reference at ({:.4g}, {:.4g}, {:.4g}) mm, nearer than contact can "
          "hold them apart: move them apart, or mend the mesh",
          contact.said_at.empty() ? "" : contact.said_at + ": ", model.name_of(a.index), at->x(), at->y(), at->z()));
    }
  }
}

}  // namespace tunica
