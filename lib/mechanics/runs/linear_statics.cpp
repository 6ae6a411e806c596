#include "tunica/mechanics/runs/detail/linear_statics.hpp"

#include "tunica/core/error.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/stepped_run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

/// Corrections stop where they fall below this part of the solution (energy norm), or do not halve any more.
constexpr double fine_enough = 1e-9;
constexpr int most_corrections = 10;

/// What carries moves what it carries.
void expand(const ShellSystem& system, VectorX& moved) {
  expand_carried(system.carried, system.surfaces, system.reference, reference_configuration(system), moved);
}

/// What the linear theory leaves unbalanced, by the elements' strains (linear_forces()).
VectorX unbalanced_by(const ShellSystem& system, const FreeMask& free, const VectorX& external, const VectorX& moved) {
  VectorX internal;
  linear_forces(system, moved, internal);
  VectorX left = external - internal;
  condense(system, reference_configuration(system), left, nullptr);
  mask(free, left);
  return left;
}

/// Iterative refinement of a direct solution, and its error. The entries of the stiffness are rounded where the
/// membrane is larger than the bending by (h R / t^2)^2; the elements' strains are not, so that a residual by them sees
/// what that has done to the solution, and corrections by the factor at hand take it out again.
/// Source: Higham 2002, "Accuracy and Stability of Numerical Algorithms", chapter 12. Cost: a solve per correction,
/// mostly one in all.
AlgebraicError refine(const ShellSystem& system, TangentSolver& solver, BlockMatrix& matrix, const VectorX& external,
                      VectorX& moved) {
  AlgebraicError error;
  for (int round = 0;; ++round) {
    VectorX internal, correction;
    linear_forces(system, moved, internal);
    VectorX left = external - internal;
    condense(system, reference_configuration(system), left, nullptr);
    mask(solver.free(), left);
    if (!solver.solve(matrix, left, correction, true).solved) {
      return error;
    }
    const double before = error.relative();
    error = {std::sqrt(std::abs(dot(left, correction))), std::sqrt(std::abs(dot(moved, internal))), false};
    const bool stagnates = round > 0 && !(error.relative() < before / 2);
    if (error.relative() <= fine_enough || stagnates || round == most_corrections) {
      return error;
    }
    moved += correction;
    expand(system, moved);
  }
}

void require_digits(double error) {
  if (error > largest_round_off) {
    throw RequirementError(
        fmt::format("round-off leaves an error of {:.2g} % in the linear solution, more than {:g} %: the shell is too "
                    "thin for double precision on this mesh: take fewer elements, or a thicker wall",
                    100 * error, 100 * largest_round_off));
  }
}

}  // namespace

LinearSolver::LinearSolver(const ShellSystem& system, const RunSettings& settings)
    : system_(system), model_(*system.model), settings_(settings), solver_(system, settings), matrix_(system.pattern) {
  linear_stiffness(system, matrix_);
  VectorX none = VectorX::Zero(first_freedom(system.node_count()));
  condense(system, reference_configuration(system), none, &matrix_);
}

LinearSolution LinearSolver::solve(const std::vector<double>& factors, const VectorX& prescribed) {
  Forces forces;
  evaluate(system_, {reference_configuration(system_), factors}, forces, nullptr);
  LinearSolution solution{prescribed, std::move(forces.external), {}, 0, false};
  expand(system_, solution.moved);
  const VectorX right = unbalanced_by(system_, solver_.free(), solution.external, solution.moved);
  if (system_.prestress_residual && residual(solution) <= settings_.converge) {  // at rest as it was imaged
    solution.converged = true;
    return solution;
  }
  VectorX increment;
  const TangentSolver::Result solved = solver_.solve(matrix_, right, increment, factored_);
  factored_ = true;
  if (!solved.solved || !solved.positive_definite) {
    throw RequirementError(
        "the linear stiffness is not positive definite: the model is not held, or its elements are "
        "too distorted for double precision");
  }
  solution.moved += increment;
  solution.cg_iterations = solved.cg_iterations;
  solution.converged = solved.converged;
  expand(system_, solution.moved);
  solution.error = solved.error;
  if (settings_.solver != Solver::cg) {
    solution.error = refine(system_, solver_, matrix_, solution.external, solution.moved);
    require_digits(solution.error->relative());
  } else if (!settings_.cg_fixed_count) {
    if (!solved.converged) {
      throw RequirementError(
          fmt::format("conjugate gradients stopped at a relative residual of {:.3g} after {} "
                      "iterations: use the direct solver or allow more iterations",
                      solved.residual, solved.cg_iterations));
    }
    require_digits(unseen_error(right, increment, solution));
  }
  take_out_linear_rigid_motion(system_, solution.moved);
  return solution;
}

double LinearSolver::residual(const LinearSolution& solution) const {
  VectorX internal;
  linear_forces(system_, solution.moved, internal);
  const double scale = std::max(force_norm(system_, solution.external), force_norm(system_, internal));
  VectorX left = solution.external - internal;
  condense(system_, reference_configuration(system_), left, nullptr);
  mask(solver_.free(), left);
  return scale > 0 ? force_norm(system_, left) / scale : 0;
}

/// Of a solution by conjugate gradients, along itself: what the stiffness and the elements' strains disagree by.
double LinearSolver::unseen_error(const VectorX& right, const VectorX& increment,
                                  const LinearSolution& solution) const {
  VectorX product;
  multiply(matrix_, increment, product);
  mask(solver_.free(), product);
  const VectorX by_strains = right - unbalanced_by(system_, solver_.free(), solution.external, solution.moved);
  const double energy = std::abs(dot(increment, by_strains));
  return energy > 0 ? std::abs(dot(increment, product - by_strains)) / energy : 0;
}

namespace {

class LinearLoads final : public SteppedRun {
public:
  LinearLoads(ShellSystem& system, const RunSettings& settings, const StaticRun& run, const StateCallback& on_state)
      : SteppedRun(system, settings, on_state, run.load_factors.size()), run_(run), solver_(system, settings) {}

private:
  State begin() override {
    summary_.dof = solver_.freedom_count();
    State state = reference_state();
    state.linear = true;
    return state;
  }

  [[nodiscard]] Checkpoint checkpoint() const override {
    Checkpoint now;
    now.position = run_.load_factors[summary_.steps - 1];
    return now;
  }

  State take_step() override {
    const double factor = run_.load_factors[summary_.steps];
    return state_of(solver_.solve(load_factors(model_, true, factor), prescribed_positions(system_, factor)), factor);
  }

  [[nodiscard]] State state_of(const LinearSolution& solution, double factor) const {
    const VectorX& moved = solution.moved;
    Configuration configuration = reference_configuration(system_);
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      configuration.displacement[i] = moved.segment<3>(first_freedom(i));
      if (i >= system_.first_solid_node) {
        configuration.pressure[i] = moved[first_freedom(i) + 3];
      } else {
        configuration.rotation[i] = exponential(moved.segment<3>(first_freedom(i) + 3));
      }
    }
    State state = make_state(system_, configuration, factor);
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      state.rotation[i] =
          i < system_.first_solid_node ? Vec3(moved.segment<3>(first_freedom(i) + 3)) : Vec3(Vec3::Zero());
    }
    VectorX internal, at_rest;
    linear_forces(system_, moved, internal);
    linear_forces(system_, VectorX::Zero(moved.size()), at_rest);
    state.linear = true;
    state.load_factor = factor;
    state.strain_energy = 0.5 * moved.dot(internal + at_rest);
    state.residual = solver_.residual(solution);
    state.newton_iterations = 1;
    state.cg_iterations = solution.cg_iterations;
    state.converged = solution.converged;
    set_algebraic_error(solution.error, state);
    return state;
  }

  const StaticRun& run_;
  LinearSolver solver_;
};

}  // namespace

Summary run_linear(ShellSystem& system, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  return LinearLoads(system, settings, run, on_state).follow(progress, resumption);
}

}  // namespace tunica
