#pragma once

#include "tunica/mechanics/algebra/free_mask.hpp"

#include <memory>

namespace tunica {

/// Sparse direct factorisation P A P' = L S L' of the symmetric part of a block matrix on its free freedoms, S = +-1:
/// multifrontal, without pivoting, so it counts the negative pivots of an indefinite matrix, and is stable enough where
/// none is tiny. Ordering (AMD or METIS, whichever fills less) and symbolic analysis by CHOLMOD on the graph of the
/// nodes, once. The same to the bit whatever the number of threads.
/// Source: Duff, Reid 1983, "The multifrontal solution of indefinite sparse symmetric linear equations".
class DirectSolver {
public:
  /// @param pattern  as make_block_matrix() makes it
  /// Errors: InputError when `free` has not 6 entries per node; MemoryError when the factor does not fit into the
  /// memory.
  DirectSolver(const BlockMatrix& pattern, const FreeMask& free);
  ~DirectSolver();
  DirectSolver(DirectSolver&&) noexcept;
  DirectSolver& operator=(DirectSolver&&) = delete;
  DirectSolver(const DirectSolver&) = delete;
  DirectSolver& operator=(const DirectSolver&) = delete;

  struct Factored {
    std::size_t negative_pivots = 0;
    bool regular = true;  ///< false: a pivot vanished, there is no factor to solve with
  };
  /// Errors: InputError when the matrix has not the size of the pattern; Interrupted.
  Factored factor(const BlockMatrix& matrix);

  /// x = A^-1 b on the free freedoms, with the last factor. Errors: InputError when b has another size.
  void solve(const VectorX& b, VectorX& x) const;

  /// Multiplications of one factor() and of one solve().
  [[nodiscard]] double factor_work() const;
  [[nodiscard]] double solve_work() const;

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tunica
