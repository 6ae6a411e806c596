#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"

namespace tunica {

/// Displacements and rotation vectors of the linear theory (6 per node), and what they are in balance with.
struct LinearSolution {
  VectorX moved;
  VectorX external;
  std::optional<AlgebraicError> error;
  std::size_t cg_iterations = 0;
  bool converged = false;
};

/// The linear theory about the reference, for one load after another: one factorisation, and iterative refinement by
/// the elements' strains. What the reference bears already (prestress) is in balance with its part of the loads.
class LinearSolver {
public:
  LinearSolver(const ShellSystem& system, const RunSettings& settings);

  /// @param factors  of the loads, in their order; prescribed  displacements, 6 per node
  /// Errors: RequirementError: not positive definite; digits are missing.
  LinearSolution solve(const std::vector<double>& factors, const VectorX& prescribed);

  /// What is left out of balance, of the forces.
  [[nodiscard]] double residual(const LinearSolution& solution) const;
  [[nodiscard]] std::size_t freedom_count() const { return solver_.freedom_count(); }

private:
  [[nodiscard]] double unseen_error(const VectorX& right, const VectorX& increment,
                                    const LinearSolution& solution) const;

  const ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  TangentSolver solver_;
  BlockMatrix matrix_;
  bool factored_ = false;
};

}  // namespace tunica
