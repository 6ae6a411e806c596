// mechanics/algebra: block matrices and their solvers.
#pragma once

#include <cstddef>
#include <vector>

/// How far an iterate of conjugate gradients is from the solution of its linear system, in the energy norm.
///
/// Iteration j lowers the squared energy norm of the error by term_j = step_j (r_j, z_j), so the sum of the terms from
/// iteration k on is the squared error of iterate k, and every part of that sum a lower bound. In exact arithmetic; in
/// floating point too until the error is as small as round-off lets it be.
/// Source: Hestenes, Stiefel 1952; Strakos, Tichy 2002; Meurant, Papez, Tichy 2021, "Accurate error estimation in CG".
namespace tunica {

struct AlgebraicError {
  double error = 0;             ///< energy norm of the error, sqrt(N mm)
  double solution = 0;          ///< energy norm of the solution
  bool is_lower_bound = false;  ///< the true error is at least this; otherwise it is an estimate of it

  /// Error over solution; 0 where both vanish.
  [[nodiscard]] double relative() const { return solution > 0 ? error / solution : 0; }
};

/// What the terms of a run from a zero start say about iterate `iterate`, at most terms.size().
AlgebraicError error_of_iterate(const std::vector<double>& terms, std::size_t iterate);

/// Whether the terms so far hold at least 3/4 of the squared error of iterate `iterate`, judged by the slowest recent
/// convergence of the same run. Source: Meurant, Papez, Tichy 2021, algorithm 1 (tau = 0.25).
bool estimate_is_settled(const std::vector<double>& terms, std::size_t iterate);

}  // namespace tunica
