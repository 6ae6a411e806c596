#pragma once

#include "tunica/io/scene/scene.hpp"

#include <cmath>

/// What the checks of a scene and the finding of its nodes have in common.
namespace tunica {

inline bool is_positive(double value) { return value > 0 && std::isfinite(value); }

/// The names of the bodies that deform, in the order of their numbers.
std::vector<std::string> deforming_names(const Scene& scene);

/// The number of a body that deforms. Errors: as Place::fail(): there is none of that name, or it is rigid.
/// @param key  of `places`, where the name was said
std::size_t body_index(const Scene& scene, const std::string& name, const Places& places,
                       std::string_view key = "body");

/// The rigid body of that name, by its place in the scene.
std::optional<std::size_t> rigid_index(const Scene& scene, std::string_view name);

/// The party of a contact. Errors: as Place::fail(): there is none of that name.
ContactParty party_named(const Scene& scene, const std::string& name, const Place& place);

/// Calls visit(item, where) for all that say where, if they do.
template <typename Visit>
void for_each_where(const Scene& scene, const Visit& visit) {
  const auto each = [&](const auto& items) {
    for (const auto& item : items) {
      visit(item, std::optional<Selection>(item.where));
    }
  };
  each(scene.fixes);
  each(scene.supports);
  each(scene.loads);
  each(scene.attachments);
}

/// Whether there is nothing but shells.
inline bool is_of_shells_alone(const Scene& scene) {
  return scene.solids.empty() && scene.rigids.empty() && scene.attachments.empty() && scene.contacts.empty();
}

/// Whether a body is one of tetrahedra.
inline bool is_solid(const Scene& scene, std::size_t body) { return body >= scene.shells.size(); }

}  // namespace tunica
