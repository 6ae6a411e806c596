#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

namespace tunica {

/// Gives the reference the stress that balances the pressures `imaged_at` on the shape of the image: that of the linear
/// solution there, whose displacements are dropped. The reference is then at rest under these pressures, and the loads
/// move it on from there. Where equilibrium alone decides the stress (membrane forces of a closed shell), it is that of
/// the living wall; its bending part is that of a wall without residual stress. Young's modulus has no influence where
/// all bodies have the same. What nothing holds but contact, inertia or an elastic bed is held statically determinate
/// meanwhile. Nothing where no pressure has an `imaged_at`, or where the reference bears its stress already.
/// Source: Joldes, Miller, Wittek, Doyle 2016, "A simple, effective and clinically applicable method to compute
/// abdominal aortic aneurysm wall stress"; Gee, Forster, Wall 2010, "A computational strategy for prestressing
/// patient-specific biomechanical problems under finite deformation".
/// Errors: InputError: nothing bears the pressure; RequirementError: as LinearSolver. Cost: one linear solve.
void add_prestress(ShellSystem& system, const RunSettings& settings);

/// Whether the reference with this stress is a stable state of rest under the pressures of the image: its tangent is
/// positive definite. None where it bears no such stress, where Young's modulus of some shell is not known, so that how
/// stiff the wall is says nothing, and with contact. Errors: as add_prestress(). Cost: one factorisation.
std::optional<bool> rests_as_imaged(ShellSystem& system, RunSettings settings);

/// Adds the stress of linear displacements (6 per node) to what the reference bears.
void add_stress(ShellSystem& system, const VectorX& moved);

}  // namespace tunica
