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

class LinearLoads final : public SteppedRun {
public:
  LinearLoads(ShellSystem& system, const Model& model, const RunSettings& settings, const StaticRun& run,
              const StateCallback& on_state)
      : SteppedRun(system, model, settings, on_state, run.load_factors.size()),
        run_(run),
        solver_(system, settings),
        matrix_(system.pattern) {
    linear_stiffness(system, matrix_);
    VectorX none = VectorX::Zero(first_freedom(system.node_count()));
    condense(system, reference_configuration(system), none, &matrix_);
  }

private:
  State begin() override {
    summary_.dof = solver_.freedom_count();
    State state = reference_state();
    state.linear = true;
    return state;
  }

  [[nodiscard]] Checkpoint checkpoint() const override {
    return {{}, run_.load_factors[summary_.steps - 1], {}, {}, {}};
  }

  State take_step() override {
    const double factor = run_.load_factors[summary_.steps];
    Forces forces;
    evaluate(system_, model_, reference_configuration(system_), load_factors(model_, true, factor), {}, forces,
             nullptr);
    const VectorX& external = forces.external;
    VectorX moved = prescribed_positions(system_, model_, factor);
    expand(system_, moved);
    const VectorX right = unbalanced_by(system_, solver_.free(), external, moved);
    VectorX solution;
    const TangentSolver::Result solved = solver_.solve(matrix_, right, solution, factored_);
    factored_ = true;
    if (!solved.solved || !solved.positive_definite) {
      throw RequirementError(
          "the linear stiffness is not positive definite: the model is not held, or its elements are "
          "too distorted for double precision");
    }
    moved += solution;
    expand(system_, moved);
    std::optional<AlgebraicError> error = solved.error;
    if (settings_.solver != Solver::cg) {
      error = refine(system_, solver_, matrix_, external, moved);
      require_digits(error->relative());
    } else if (!settings_.cg_fixed_count) {
      if (!solved.converged) {
        throw RequirementError(
            fmt::format("conjugate gradients stopped at a relative residual of {:.3g} after {} "
                        "iterations: use the direct solver or allow more iterations",
                        solved.residual, solved.cg_iterations));
      }
      require_digits(unseen_error(right, solution, external, moved));
    }
    take_out_linear_rigid_motion(system_, moved);
    State state = state_of(moved, external, factor);
    state.cg_iterations = solved.cg_iterations;
    state.converged = solved.converged;
    set_algebraic_error(error, state);
    return state;
  }

  /// Of a solution by conjugate gradients, along itself: what the stiffness and the elements' strains disagree by.
  double unseen_error(const VectorX& right, const VectorX& solution, const VectorX& external, const VectorX& moved) {
    VectorX product;
    multiply(matrix_, solution, product);
    mask(solver_.free(), product);
    const VectorX by_strains = right - unbalanced_by(system_, solver_.free(), external, moved);
    const double energy = std::abs(dot(solution, by_strains));
    return energy > 0 ? std::abs(dot(solution, product - by_strains)) / energy : 0;
  }

  static void require_digits(double error) {
    if (error > largest_round_off) {
      throw RequirementError(fmt::format(
          "round-off leaves an error of {:.2g} % in the linear solution, more than {:g} %: the shell is too "
          "thin for double precision on this mesh: take fewer elements, or a thicker wall",
          100 * error, 100 * largest_round_off));
    }
  }

  [[nodiscard]] State state_of(const VectorX& moved, const VectorX& external, double factor) const {
    VectorX internal;
    linear_forces(system_, moved, internal);
    Configuration configuration = reference_configuration(system_);
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      configuration.displacement[i] = moved.segment<3>(first_freedom(i));
      if (i >= system_.first_solid_node) {
        configuration.pressure[i] = moved[first_freedom(i) + 3];
      } else {
        configuration.rotation[i] = exponential(moved.segment<3>(first_freedom(i) + 3));
      }
    }
    State state = make_state(system_, model_, configuration, factor);
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      state.rotation[i] =
          i < system_.first_solid_node ? Vec3(moved.segment<3>(first_freedom(i) + 3)) : Vec3(Vec3::Zero());
    }
    VectorX left = external - internal;
    condense(system_, reference_configuration(system_), left, nullptr);
    mask(solver_.free(), left);
    const double scale = std::max(force_norm(system_, external), force_norm(system_, internal));
    state.linear = true;
    state.load_factor = factor;
    VectorX at_rest;
    linear_forces(system_, VectorX::Zero(moved.size()), at_rest);
    state.strain_energy = 0.5 * moved.dot(internal + at_rest);
    state.residual = scale > 0 ? force_norm(system_, left) / scale : 0;
    state.newton_iterations = 1;
    return state;
  }

  const StaticRun& run_;
  TangentSolver solver_;
  BlockMatrix matrix_;
  bool factored_ = false;
};

}  // namespace

Summary run_linear(ShellSystem& system, const Model& model, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  return LinearLoads(system, model, settings, run, on_state).follow(progress, resumption);
}

}  // namespace tunica
