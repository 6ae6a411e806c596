#pragma once

#include "tunica/mechanics/model/model.hpp"

/// Of what the journals of the harness are, and of its seeds: four nodes, a contact and a rigid body.
namespace tunica::fuzz {

/// A model that is only counted, not computed with.
inline Model journal_model() {
  Model model;
  ShellBody plate;
  plate.name = "plate";
  plate.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  plate.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  model.shells.push_back(plate);
  model.rigids.push_back({"tool", RigidSphere{{{{0, Vec3::Zero()}}}, {{{0, 1}}}}, {}, ""});
  model.contacts.push_back({"push", {ContactParty{true, 0}, ContactParty{false, 0}}});
  return model;
}

}  // namespace tunica::fuzz
