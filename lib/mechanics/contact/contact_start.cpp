#include "tunica/core/error.hpp"
#include "tunica/mechanics/contact/detail/contact_parts.hpp"
#include "tunica/surface/distance/signed_distance.hpp"

#include <fmt/format.h>

namespace tunica {
namespace {

/// The surface of one body in the reference; of a solid it is closed.
TriangleMesh surface_of(const Surfaces& surfaces, std::size_t body, const std::vector<Vec3>& reference) {
  TriangleMesh mesh{reference, {}};
  for (std::size_t f = surfaces.first[body]; f < surfaces.first[body + 1]; ++f) {
    mesh.triangles.push_back(surfaces.faces[f].nodes);
  }
  return mesh;
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

}  // namespace

/// Of solids the distance of every sample from the whole surface counts, so that a body wholly inside is found.
void ContactSystem::require_apart(const Model& model) {
  const FaceMaps& maps = *accepted_;
  const auto near = near_faces(maps, 0);
  std::map<std::size_t, std::pair<SignedDistance, Bounds>> solids;
  const auto solid = [&](std::size_t body) -> const std::pair<SignedDistance, Bounds>& {
    const auto found = solids.find(body);
    if (found != solids.end()) {
      return found->second;
    }
    const TriangleMesh mesh = surface_of(surfaces_, body, reference_);
    Bounds box{Vec3::Constant(infinity), Vec3::Constant(-infinity)};
    for (const auto& triangle : mesh.triangles) {
      for (const Index i : triangle) {
        box.lower = box.lower.cwiseMin(reference_[i]);
        box.upper = box.upper.cwiseMax(reference_[i]);
      }
    }
    return solids.emplace(body, std::pair(SignedDistance(mesh), box)).first->second;
  };
  Overlap deepest;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Group& group = groups_[g];
    if (group.point && model.is_solid(group.other.index)) {
      deepest.look(solid(group.other.index).first.at(place(group, group.samples[0], maps)).distance,
                   same_distance * group.wall, group.contact);
      continue;
    }
    const SurfaceFace& face = surfaces_.faces[group.face];
    const bool in_solid = !group.point && !group.other.rigid && model.is_solid(group.other.index) &&
                          group.other.index != face.body && !is_carried(face, group.other.index);
    if (in_solid) {
      const auto& [distance, box] = solid(group.other.index);
      for (std::size_t i = 0; box.meets(maps.bounds(group.face), face.half_thickness) && i < group.samples.size();
           ++i) {
        const Vec3 x = maps[group.face].point(group.samples[i].weights);
        deepest.look(distance.at(x).distance - face.half_thickness, same_distance * group.wall, group.contact);
      }
    } else if (is_close(group, near[g], maps)) {
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

}  // namespace tunica
