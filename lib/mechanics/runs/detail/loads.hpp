#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

namespace tunica {

/// Fills `dead` from the model's loads; elements, masses and surfaces are there.
/// Errors: InputError: a load on a node that no element uses.
void make_loads(ShellSystem& system);

/// The pressures that follow the surface, MPa, per shell element, or per face of the surfaces of solids.
std::vector<double> follower_pressures(const ShellSystem& system, const std::vector<double>& factors, bool of_solids);

/// All pressures on the shell elements, MPa. @param factors  of the loads
std::vector<double> shell_pressures(const ShellSystem& system, const std::vector<double>& factors);

}  // namespace tunica
