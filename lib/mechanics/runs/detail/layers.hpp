#pragma once

#include "tunica/mechanics/runs/detail/recovery.hpp"

namespace tunica {

/// Strains below this are round-off: their jumps say nothing.
inline constexpr double least_strain = 1e-9;

/// mJ.
struct ShellEnergy {
  double stretching = 0, bending = 0;
  double force_jumps = 0, moment_jumps = 0;  ///< of what the recovered fields have over the shell's own
};
ShellEnergy shell_energy(const ShellElement& element, const Material& material, const TensorPair& own,
                         const std::array<TensorPair, 3>& corners);

/// Of ElementFields::layer_error.
/// @param shells  membrane forces and moments of all shells; corners  recovered from these
std::vector<double> layer_errors(const ShellSystem& system, std::span<const TensorPair> shells,
                                 std::span<const std::array<TensorPair, 3>> corners);

}  // namespace tunica
