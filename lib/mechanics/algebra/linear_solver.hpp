#pragma once

#include "tunica/mechanics/algebra/algebraic_error.hpp"
#include "tunica/mechanics/algebra/direct_solver.hpp"

#include <optional>

/// Solving for the free freedoms. Held ones are marked in `free` (6 per node) and stay zero in every solution. Errors:
/// InputError: marks or numbers that are not six per node.
namespace tunica {

struct CgOptions {
  double tolerance = 1e-10;         ///< relative residual
  std::optional<std::size_t> most;  ///< iterations at most; none: 20 x freedoms
  bool fixed_count = false;         ///< run exactly `most` and ask for no tolerance
};

struct CgResult {
  std::size_t iterations = 0;
  double residual = 0;  ///< relative
  bool converged = false;
  bool negative_curvature = false;  ///< the matrix is not positive definite; x is the last good iterate
  /// Of x. An estimate where the tolerance was reached, a lower bound where the iterations ended before; none where the
  /// matrix is not positive definite.
  std::optional<AlgebraicError> error;
};

/// Conjugate gradients on the free freedoms, preconditioned by the 6x6 diagonal blocks. The matrix must be symmetric.
/// A run of a fixed count ends early only when the residual is exactly zero or the round-off floor is reached.
/// After the last iteration the recursion goes on for the sake of the error alone: x and the counts do not change.
/// Cost of that: a tenth of the iterations where they ended before the tolerance; else as many as it takes to have most
/// of the error: a few where convergence is fast, up to four times as many again where it stagnates; where that is not
/// enough, the error is a lower bound. Errors: InputError also where a tolerance is asked for that is not
/// finite or below zero.
CgResult conjugate_gradients(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b,
                             const CgOptions& options, VectorX& x);

/// GMRES on the free freedoms for the unsymmetric matrix itself, preconditioned by `solver`'s factor of the symmetric
/// part; starts from x. @return the relative residual reached: 1e-4, or what 30 iterations come to.
/// Why: applied moments and pressure at free edges make the tangent unsymmetric at a few nodes; this costs a few
/// solves with the factor at hand, and keeps Newton's method quadratic.
double gmres(const BlockMatrix& matrix, const FreeMask& free, const DirectSolver& solver, const VectorX& b, VectorX& x);

/// Error of x as a solution of the symmetric part of the matrix, by one more solve with `solver`'s factor of it.
AlgebraicError error_by_factor(const BlockMatrix& matrix, const FreeMask& free, const DirectSolver& solver,
                               const VectorX& b, const VectorX& x);

}  // namespace tunica
