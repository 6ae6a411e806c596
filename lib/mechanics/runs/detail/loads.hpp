#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

namespace tunica {

/// Fills `dead` and `follower_pressures` from the model's loads; elements, masses and surfaces are there.
/// Errors: InputError: a load on a node that no element uses.
void make_loads(ShellSystem& system, const Model& model);

}  // namespace tunica
