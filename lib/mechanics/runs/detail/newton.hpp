#pragma once

#include "tunica/mechanics/algebra/linear_solver.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include <functional>
#include <optional>

namespace tunica {

/// Round-off may leave this part of a solution open, well below what any mesh does; more and there is no answer.
inline constexpr double largest_round_off = 1e-3;

/// Which freedoms no support holds.
FreeMask free_freedoms(const ShellSystem& system);

/// One linear system after another with the same pattern, by the solver that the settings ask for. What only depends on
/// the pattern is made ready by the first.
class TangentSolver {
public:
  TangentSolver(const ShellSystem& system, const RunSettings& settings);

  struct Result {
    bool solved = false;     ///< x can be used
    bool converged = false;  ///< to the solver's own tolerance
    bool positive_definite = false;
    double residual = 0;  ///< relative
    std::size_t cg_iterations = 0;
    std::optional<AlgebraicError> error;  ///< cg: always; direct: where asked for
  };
  /// Solves matrix x = b on the free freedoms. The direct solver also follows the unsymmetric part of the matrix.
  /// The cg solver symmetrises `matrix` in place.
  /// @param same_matrix  the values are those of the last call: the factor at hand is used again
  Result solve(BlockMatrix& matrix, const VectorX& b, VectorX& x, bool same_matrix = false);

  /// Whether the symmetric part of a matrix is positive definite on the free freedoms, by a factorisation, with the cg
  /// solver too: its iterations see the modes that the load drives, to the digits that they are asked for.
  /// Errors: MemoryError: the factor does not fit into the memory.
  bool is_positive_definite(const BlockMatrix& matrix);

  /// Whether the direct solver tells the error of its solutions, for one more solve each.
  void tell_direct_error(bool tell) { tell_direct_error_ = tell; }
  [[nodiscard]] bool tells_direct_error() const { return tell_direct_error_; }

  [[nodiscard]] const FreeMask& free() const { return free_; }
  [[nodiscard]] std::size_t freedom_count() const;

private:
  void factor(const BlockMatrix& matrix);

  const RunSettings& settings_;
  FreeMask free_;
  std::optional<DirectSolver> direct_;
  DirectSolver::Factored factored_;  ///< of the last matrix
  std::size_t pressures_ = 0;        ///< each makes a pivot negative
  bool tell_direct_error_ = false;
};

/// What keeps a configuration from equilibrium.
struct Balance {
  VectorX unbalanced;  ///< external - internal (- inertia), 6 per node, also at held freedoms
  double scale = 0;    ///< norm of the forces that should cancel
  double floor = 0;    ///< round-off of the norm of `unbalanced`
  bool valid = false;
};
/// At an instant: by the sum of all terms, with what is carried condensed.
Balance balance_at(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent);

/// `predicted` as in Instant; empty: none.
using BalanceFunction =
    std::function<Balance(const Configuration&, BlockMatrix* tangent, const std::vector<ElementState>& predicted)>;

struct NewtonResult {
  bool apart = true;  ///< it is certain that nothing passed through anything
  /// Residual below the tolerance, or at the floor of round-off with increments below largest_round_off of the change.
  bool converged = false;
  bool linear_converged = false;  ///< the last linear system was solved to its own tolerance
  bool stable = false;            ///< the last tangent was positive definite
  bool valid = false;             ///< the configuration can be used: finite, no element collapsed
  double residual = 0;            ///< relative
  std::size_t iterations = 0;
  std::size_t cg_iterations = 0;
  /// Of the last linear solve, relative to the largest increment: what the algebra leaves of the step's change.
  std::optional<AlgebraicError> algebraic_error;
  double predicted = 0;  ///< size of the first increment; rotations count with the mean edge length
  double reached = 0;    ///< size of the whole change
};

/// Newton's method from `configuration`, which is changed. Stresses count as unknowns of their own, eliminated in each
/// element: the geometric stiffness takes those that the last tangent expects, not those of the configuration, whose
/// membrane part any bending of a thin shell overstates by far. It meets the same equilibrium in fewer iterations.
/// Source: Magisano, Leonetti, Garcea 2017, "How to improve efficiency and robustness of the Newton method in
/// geometrically non-linear structural problem discretized via displacement-based finite elements". `held_increment` (6
/// per node) moves prescribed freedoms. Steps are cut where they turn a node by more than 0.5 rad; where the residual
/// does not fall in the end, a line search on the work of the unbalanced forces shortens them.
/// @param likely_at_rest  the configuration may be in balance: the forces are looked at before a tangent is made
/// @param fewest_iterations  of a configuration that is not in balance
NewtonResult newton(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, const VectorX& held_increment, BlockMatrix& matrix,
                    Configuration& configuration, bool likely_at_rest = false, std::size_t fewest_iterations = 1);

/// Size of an increment: root mean square over the nodes of displacements and (mean edge length x) rotations.
double increment_size(const ShellSystem& system, const VectorX& increment);

/// The farthest that an increment moves a node, mm.
double largest_shift(const VectorX& increment);

}  // namespace tunica
