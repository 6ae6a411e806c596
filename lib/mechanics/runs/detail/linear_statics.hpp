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

  /// By how much the theory of large rotations moves less, more or aside than a linear solution, relative to what that
  /// gives; of prescribed motion, by how much its forces differ. From the path's expansion about the reference, to the
  /// third order, with the wall free to relax in the second by the tangent under the load: a bed may be far softer than
  /// what tension turns back. 1 at least where the path has a limit load or buckles before. Source: Koiter 1945, "Over
  /// de stabiliteit van het elastisch evenwicht"; Haftka, Mallett, Nachbar 1971, "Adaption of Koiter's method to finite
  /// element analysis of snap-through buckling behavior". Cost: a factorisation in place of that of the stiffness, two
  /// to eight solves, four evaluations of the forces each. Limits: an order of magnitude where it passes 1.
  double departure(ShellSystem& system, const LinearSolution& solution, const std::vector<double>& factors);

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

/// The tangent at the reference with the stress of a linear solution, under the loads: of linear buckling, which leaves
/// out that the solution moves the shell. Cost: linear.
BlockMatrix stressed_tangent(ShellSystem& system, const VectorX& solution, const std::vector<double>& factors);

}  // namespace tunica
