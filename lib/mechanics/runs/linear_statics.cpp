#include "tunica/mechanics/runs/detail/linear_statics.hpp"

#include "tunica/core/error.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/prestress.hpp"
#include "tunica/mechanics/runs/detail/stepped_run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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

BlockMatrix stressed_tangent(ShellSystem& system, const VectorX& solution, const std::vector<double>& factors) {
  Forces forces;
  BlockMatrix tangent = system.pattern;
  auto elements = system.elements;
  auto solids = system.solids;
  add_stress(system, solution);
  evaluate(system, {reference_configuration(system), factors}, forces, &tangent);
  VectorX unbalanced = forces.external - forces.internal;  // what ties bear turns with them
  condense(system, reference_configuration(system), unbalanced, &tangent);
  system.elements = std::move(elements);
  system.solids = std::move(solids);
  return tangent;
}

namespace {

Configuration configuration_of(const ShellSystem& system, const VectorX& moved) {
  Configuration configuration = reference_configuration(system);
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    configuration.displacement[i] = moved.segment<3>(first_freedom(i));
    if (i >= system.first_solid_node) {
      configuration.pressure[i] = moved[first_freedom(i) + 3];
    } else {
      configuration.rotation[i] = exponential(moved.segment<3>(first_freedom(i) + 3));
    }
  }
  return configuration;
}

/// The load, as a part of all of it, at which the deformation has reached 1 of its linear amount where it grows as
/// load + second load^2 + third load^3: the smallest positive root of s - second s^2 + (2 second^2 - third) s^3 = 1,
/// which is that series reverted. None: the load has a limit before, where Newton's method meets a slope of zero.
std::optional<double> amount_at_load(double first, double second, double third) {
  constexpr int most_steps = 60;
  const double square = -second, cube = 2 * second * second - third;
  double s = 0;
  for (int k = 0; k < most_steps; ++k) {
    const double slope = first + 2 * square * s + 3 * cube * s * s;
    if (slope <= 0) {
      return {};
    }
    const double step = (1 - s * (first + s * (square + s * cube))) / slope;
    s += step;
    if (std::abs(step) < 1e-6 * std::abs(s)) {
      return s;
    }
  }
  return s;
}

/// What the theory of large rotations leaves unbalanced beyond the linear one where a part of a linear solution, and
/// what that bends to in the second order, has been followed.
class BeyondLinear {
public:
  BeyondLinear(const ShellSystem& system, const LinearSolution& solution, const std::vector<double>& factors)
      : system_(system), moved_(solution.moved), factors_(factors), scaled_(factors.size(), 0.0) {
    Forces forces;
    evaluate(system, {reference_configuration(system), scaled_}, forces, nullptr);
    resting_ = forces.external;
    brought_ = solution.external - resting_;
    VectorX internal, at_rest;
    linear_forces(system, moved_, internal);
    linear_forces(system, VectorX::Zero(moved_.size()), at_rest);
    energy_ = moved_.dot(internal - at_rest);
  }

  [[nodiscard]] double energy() const { return energy_; }  ///< N mm, twice that of the linear solution
  [[nodiscard]] bool is_driven() const { return 2 * moved_.dot(brought_) < energy_; }  ///< by what is prescribed
  [[nodiscard]] bool valid() const { return valid_; }

  /// 6 per node that is not carried, what grows as the square of the part.
  VectorX even(double part) {
    const VectorX moved = part * moved_;
    return 0.5 * (at(moved, part) + at(-moved, -part));
  }

  /// The rest, over the part.
  VectorX odd(double part, const VectorX& bent) {
    const VectorX moved = part * moved_;
    return 0.5 * (at(moved + bent, part) - at(bent - moved, -part)) / part;
  }

private:
  VectorX at(const VectorX& moved, double part) {
    std::ranges::transform(factors_, scaled_.begin(), [&](double factor) { return part * factor; });
    // What is carried turns with what carries it, and acts there.
    Configuration there = reference_configuration(system_);
    advance_configuration(system_, moved, there);
    Forces forces;
    evaluate(system_, {there, scaled_}, forces, nullptr);
    valid_ = valid_ && forces.valid;
    VectorX left = forces.external - forces.internal;
    condense(system_, there, left, nullptr);
    VectorX linear;
    linear_forces(system_, moved, linear);
    linear = resting_ + part * brought_ - linear;
    condense(system_, reference_configuration(system_), linear, nullptr);
    return left - linear;
  }

  const ShellSystem& system_;
  const VectorX& moved_;
  const std::vector<double>& factors_;
  std::vector<double> scaled_;
  VectorX resting_, brought_;
  double energy_ = 0;
  bool valid_ = true;
};

double largest_move(const VectorX& moved) {
  double most = 0;
  for (Eigen::Index i = 0; i < moved.size(); i += first_freedom(1)) {
    most = std::max(most, moved.segment<3>(i).norm());
  }
  return most;
}

}  // namespace

double LinearSolver::departure(ShellSystem& system, const LinearSolution& solution,
                               const std::vector<double>& factors) {
  BeyondLinear beyond(system, solution, factors);
  if (!(beyond.energy() > 0)) {
    return 0;  // nothing moves
  }
  BlockMatrix tangent = stressed_tangent(system, solution.moved, factors);
  symmetrise(tangent);
  VectorX none;
  factored_ = false;
  // Beyond the buckling load: a strip pushed along itself shows nothing else of it.
  if (!solver_.solve(tangent, VectorX::Zero(solution.moved.size()), none).positive_definite) {
    return 1;
  }
  const auto response_to = [&](VectorX left) {
    mask(solver_.free(), left);
    VectorX response = VectorX::Zero(left.size());
    solver_.solve(tangent, left, response, true);
    expand(system, response);
    return response;
  };
  const double motion = largest_move(solution.moved);
  constexpr double least = 1e-3, largest = 0.064;  // parts of the load
  double first = 0, aside = 0;
  if (system.prestress_residual) {  // what the reference bears already counts in proportion to the load
    const VectorX forces = beyond.odd(least, VectorX::Zero(solution.moved.size()));
    first = solution.moved.dot(forces) / beyond.energy();
    aside = largest_move(response_to(forces)) / motion;
  }
  // By ever smaller parts, until what is of higher order no longer shows, which is large in slender bodies, or what
  // round-off leaves, which is large in thin ones, grows again.
  constexpr double absolute = 0.02, relative = 0.1;
  double second = 0, third = 0, change = infinity;
  double bent_aside = 0;
  for (double part = largest; part > least && change > absolute + relative * std::abs(third); part /= 2) {
    const double square = part * part;
    const VectorX forces = beyond.even(part) / square;
    const VectorX bent = response_to(forces);
    const double work = solution.moved.dot(beyond.odd(part, square * bent)) / beyond.energy();
    const double found = (work - first) / square;
    if (part < largest && std::abs(found - third) > change) {
      break;
    }
    change = part < largest ? std::abs(found - third) : change;
    third = found;
    second = solution.moved.dot(forces) / beyond.energy();
    bent_aside = largest_move(bent) / motion;
  }
  aside = std::max(aside, bent_aside);
  if (!beyond.valid()) {
    return 1;
  }
  if (beyond.is_driven()) {  // the forces differ
    return std::max(aside, std::abs(first + second + third - 2 * second * second));
  }
  const auto amount = amount_at_load(1 - first, second, third);
  return std::max(aside, amount ? std::abs(1 - *amount) / *amount : 1);
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
    const LinearSolution solution = solution_at(factor);
    if (is_last()) {
      const double most = *std::ranges::max_element(run_.load_factors, {}, [](double f) { return std::abs(f); });
      summary_.linear_departure =
          solver_.departure(system_, most == factor ? solution : solution_at(most), load_factors(model_, true, most));
    }
    return state_of(solution, factor);
  }

  LinearSolution solution_at(double factor) {
    return solver_.solve(load_factors(model_, true, factor), prescribed_positions(system_, factor));
  }

  [[nodiscard]] State state_of(const LinearSolution& solution, double factor) const {
    const VectorX& moved = solution.moved;
    State state = make_state(system_, configuration_of(system_, moved), factor);
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
