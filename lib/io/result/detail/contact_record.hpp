#pragma once

#include "tunica/mechanics/runs/solve.hpp"

#include <limits>

/// What is kept of a state's contacts and rigid bodies, in the file and in the report. Inside lib/io.
namespace tunica {

/// Of a contact, by its number in the model; all unknown (NaN) where the state does not say.
inline ContactState contact_of(const State& state, std::size_t contact) {
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  const Vec3 nowhere = Vec3::Constant(unknown);
  return state.contacts.empty() ? ContactState{nowhere, nowhere, unknown, unknown, unknown, 0, unknown}
                                : state.contacts.at(contact);
}

/// Of a rigid body, the same.
inline RigidState rigid_of(const State& state, std::size_t rigid) {
  const Vec3 nowhere = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  return state.rigids.empty() ? RigidState{nowhere, nowhere, nowhere} : state.rigids.at(rigid);
}

}  // namespace tunica
