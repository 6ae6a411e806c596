#pragma once

#include "mechanics/direct_solver.hpp"

#include <optional>

/// Solving for the free freedoms. Held ones are marked in `free` (6 per node) and stay zero in every solution.
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
};

/// Conjugate gradients on the free freedoms, preconditioned by the 6x6 diagonal blocks. The matrix must be symmetric.
/// A run of a fixed count ends early only when the residual is exactly zero or the round-off floor is reached.
CgResult conjugate_gradients(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b,
                             const CgOptions& options, VectorX& x);

/// GMRES on the free freedoms for the unsymmetric matrix itself, preconditioned by `solver`'s factor of the symmetric
/// part; starts from x. @return the relative residual reached.
/// Why: applied moments and pressure at free edges make the tangent unsymmetric at a few nodes; this costs a few
/// solves with the factor at hand, and keeps Newton's method quadratic.
double gmres(const BlockMatrix& matrix, const FreeMask& free, DirectSolver& solver, const VectorX& b, double tolerance,
             std::size_t most, VectorX& x);

/// Sets the held entries to zero.
void mask(const FreeMask& free, VectorX& v);

}  // namespace tunica
