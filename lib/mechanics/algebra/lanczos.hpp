#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"

#include <functional>

namespace tunica {

/// B x = theta A x with symmetric matrices, A positive definite. Each operation takes x and fills y.
struct SymmetricPencil {
  using Product = std::function<void(const VectorX& x, VectorX& y)>;
  Product solve_a;  ///< y = A^-1 x
  Product multiply_a;
  Product multiply_b;
};

struct LanczosOptions {
  std::size_t count = 1;
  /// Vectors that are multiplied together. An eigenvalue of a higher multiplicity than this may lose copies.
  std::size_t block = 6;
  double tolerance = 1e-8;    ///< residual |A^-1 B x - theta x| in the norm of A, relative to theta
  double deflated_value = 1;  ///< theta of the deflated eigenvectors
  std::size_t most_solves = 20'000;
};

struct EigenPairs {
  std::vector<double> values;     ///< decreasing; fewer than asked for where the space has no more dimensions
  std::vector<VectorX> vectors;   ///< x'Ax = 1
  std::vector<double> residuals;  ///< recomputed from the vectors, relative to the largest |theta|
  double largest_magnitude = 0;   ///< of all theta, also the negative ones
  std::size_t solves = 0;
  bool converged = false;
};

/// The largest (most positive) eigenvalues, by block Lanczos with full reorthogonalisation in the inner product of A
/// and thick restarts. Shift-invert where A = K + s M and B = M: theta = 1 / (lambda + s), the smallest lambda first.
/// Source: Grimes, Lewis, Simon 1994, "A shifted block Lanczos algorithm"; Wu, Simon 2000, "Thick-restart Lanczos".
/// @param start     random vectors are drawn on the freedoms that are true in it
/// @param deflated  known eigenvectors of one eigenvalue (`options.deflated_value`), which are left out; they need not
///                  be normalised
/// Errors: InputError: a count or a block of none, a tolerance that is not above zero, known eigenvectors of
/// another size than `start` or an eigenvalue of theirs that is zero or not finite.
/// Cost: one solve with A per vector of the basis, count + 20 of them at least, and as many products with B; memory for
/// twice 2 count + 8 block vectors.
EigenPairs largest_eigenpairs(const SymmetricPencil& pencil, const std::vector<bool>& start,
                              const std::vector<VectorX>& deflated, const LanczosOptions& options);

}  // namespace tunica
