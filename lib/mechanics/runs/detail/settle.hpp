#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"

namespace tunica {

struct SettleResult {
  bool settled = false;   ///< a stable equilibrium was reached
  bool ran_away = false;  ///< the shell left every bound: some displacement passed the size of the model
  /// A tangent on the way was not positive definite, however little viscosity is left.
  bool lost_stability = false;
  double residual = 0;  ///< relative
  std::size_t iterations = 0;
  std::size_t cg_iterations = 0;
};

/// Lets a configuration, which is changed, creep downhill until it rests: a stable equilibrium of the same load, near
/// or far, or none. For states that Newton's method cannot reach because the path to them loses its stability. How:
/// pseudo-transient continuation, implicit Euler steps of a gradient flow with a viscosity that falls while they lead
/// downhill, and rises where the tangent is not positive definite; it never stops at an unstable equilibrium. Source:
/// Kelley, Keyes 1998, "Convergence analysis of pseudo-transient continuation". Cost: one or two factorisations per
/// iteration; from ten to a few hundred iterations.
SettleResult settle(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, BlockMatrix& matrix, Configuration& configuration);

/// The direction in which a configuration is least stable: displacements and spins (6 per node), the largest
/// displacement 1 mm. Zero where the tangent cannot be factored.
VectorX weakest_direction(const ShellSystem& system, TangentSolver& solver, const BalanceFunction& balance,
                          BlockMatrix& matrix, const Configuration& configuration);

}  // namespace tunica
