#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"

namespace tunica {

/// Makes contact ready for a step of the rigid bodies: samples, pairs of nodes that may meet, and what follows from
/// them. Nothing where nothing touches.
void begin_contact(ShellSystem& system, const RunSettings& settings, double from, double to,
                   const Configuration& configuration, std::optional<TangentSolver>& solver, BlockMatrix& matrix);

/// A state that is kept.
void accept_contact(const ShellSystem& system, const Configuration& configuration);

}  // namespace tunica
