#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"

namespace tunica {

struct SettleResult {
  bool settled = false;   ///< a stable equilibrium was reached
  bool ran_away = false;  ///< the shell left every bound: some displacement passed the size of the model
  /// A tangent on the way was not positive definite, however little viscosity is left.
  bool lost_stability = false;
  bool pushed_off = false;  ///< a state of balance on the way was not stable
  double residual = 0;      ///< relative
  std::size_t iterations = 0;
  std::size_t cg_iterations = 0;
};

/// Lets a configuration, which is changed, creep downhill until it rests: a stable equilibrium of the same load, near
/// or far, or none. For states that Newton's method cannot reach because the path to them loses its stability. How:
/// implicit Euler steps of a gradient flow, each solved by Newton's method, with a viscosity that falls while they are
/// found, and rises where the tangent is not positive definite; off an unstable equilibrium it is pushed along its
/// weakest direction. Source: Kelley, Keyes 1998, "Convergence analysis of pseudo-transient continuation"; Rockafellar
/// 1976, "Monotone operators and the proximal point algorithm" (steps that are solved may be long where energy is
/// stiff across the valley). Cost: from ten to a few hundred factorisations, and some ten for each state that it is
/// pushed off. Errors: MemoryError: a factor does not fit into the memory.
SettleResult settle(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, BlockMatrix& matrix, Configuration& configuration);

}  // namespace tunica
