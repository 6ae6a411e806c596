#include "core/error.hpp"
#include "mechanics/rotation.hpp"
#include "mechanics/run.hpp"
#include "mechanics/settle.hpp"
#include "mechanics/supports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace tunica {

VectorX prescribed_positions(const ShellSystem& system, const Model& model, double factor) {
  VectorX positions = VectorX::Zero(static_cast<Eigen::Index>(6 * system.node_count()));
  for (const PrescribedFreedom& p : system.prescribed) {
    positions[static_cast<Eigen::Index>(p.freedom)] = p.value * factor_of(model.fixes[p.fix].ramp, true, factor);
  }
  return positions;
}

Balance static_balance(const ShellSystem& system, const Model& model, const Configuration& configuration, double factor,
                       Forces& forces, BlockMatrix* tangent) {
  evaluate(system, model, configuration, load_factors(model, true, factor), {}, forces, tangent);
  Balance balance;
  balance.valid = forces.valid;
  balance.unbalanced = forces.external - forces.internal;
  VectorX reactions = forces.internal;
  for (std::size_t i = 0; i < system.held.size(); ++i) {
    if (!system.held[i]) {
      reactions[static_cast<Eigen::Index>(i)] = 0;
    }
  }
  balance.scale = std::max(force_norm(system, forces.external), force_norm(system, reactions));
  balance.floor = round_off(system, configuration);
  return balance;
}

namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// Smallest part of a load step that is tried before the load counts as one without equilibrium.
constexpr double smallest_part = 1.0 / 1024;
/// A step whose change is more than this times its linear prediction has left the path: up to a limit point a quadratic
/// fold gives at most 2.
constexpr double largest_departure = 3;
/// A shell that gives way by less than this part of its thickness (root mean square) has branched off its path, not
/// jumped.
constexpr double largest_branch = 0.25;
/// Part of the thickness by which a shell is pushed off a path that it may leave.
constexpr double nudge = 0.01;
/// Net load that the supports of a body held by its rigid motions may carry, relative to the load.
constexpr double largest_imbalance = 1e-3;

/// One load step to equilibrium, bodies held by their rigid motions included: their mean displacement and rotation are
/// taken out, and equilibrium found again, until both hold.
class LoadStep {
public:
  LoadStep(ShellSystem& system, const Model& model, const RunSettings& settings)
      : system_(system), model_(model), settings_(settings), solver_(system, settings), matrix_(system.pattern) {}

  NewtonResult run(double factor, double previous_factor, Configuration& configuration) {
    const auto balance = [&](const Configuration& c, BlockMatrix* tangent) {
      return static_balance(system_, model_, c, factor, forces_, tangent);
    };
    const VectorX held =
        prescribed_positions(system_, model_, factor) - prescribed_positions(system_, model_, previous_factor);
    NewtonResult result = newton(system_, settings_, solver_, balance, held, matrix_, configuration);
    const VectorX still = VectorX::Zero(held.size());
    for (int round = 0; round < 8 && result.converged; ++round) {
      bool changed = false;
      for (const Piece& piece : system_.pieces) {
        if (held_by_rigid_motions(model_, piece.body)) {
          take_out_rigid_motion(system_, piece, configuration);
          changed = true;
        }
      }
      if (!changed) {
        break;
      }
      const NewtonResult again = newton(system_, settings_, solver_, balance, still, matrix_, configuration);
      result.converged = again.converged;
      result.valid = again.valid;
      result.residual = again.residual;
      result.iterations += again.iterations;
      result.cg_iterations += again.cg_iterations;
      if (again.algebraic_error && result.algebraic_error) {
        result.algebraic_error->error = again.algebraic_error->error;
      }
      if (again.iterations == 0) {
        break;
      }
    }
    if (result.converged) {
      require_balance(configuration, factor);
    }
    return result;
  }

  /// Where the path has lost its stability: moves what is prescribed, pushes the shell off it, and lets it creep to
  /// where it can rest.
  SettleResult let_go(double factor, double previous_factor, double thickness, Configuration& configuration) {
    const auto balance = [&](const Configuration& c, BlockMatrix* tangent) {
      return static_balance(system_, model_, c, factor, forces_, tangent);
    };
    advance_configuration(configuration, prescribed_positions(system_, model_, factor) -
                                             prescribed_positions(system_, model_, previous_factor));
    advance_configuration(configuration,
                          nudge * thickness * weakest_direction(system_, solver_, balance, matrix_, configuration));
    return settle(system_, settings_, solver_, balance, matrix_, configuration);
  }

  [[nodiscard]] std::size_t freedom_count() const { return solver_.freedom_count(); }
  void tell_direct_error(bool tell) { solver_.tell_direct_error(tell); }

private:
  void require_balance(const Configuration& configuration, double factor) {
    static_balance(system_, model_, configuration, factor, forces_, nullptr);
    for (const Piece& piece : system_.pieces) {
      if (held_by_rigid_motions(model_, piece.body) && imbalance_of(piece, configuration) > largest_imbalance) {
        throw RequirementError(
            fmt::format("{}: at load factor {:.6g} the loads are no longer in balance on the deformed body, which only "
                        "its rigid motions hold: hold it by a [[fix]]",
                        model_.shells[piece.body].name, factor));
      }
    }
  }

  double imbalance_of(const Piece& piece, const Configuration& configuration) {
    ShellSystem& s = system_;
    std::vector<Vec3> reference = s.reference;
    for (const Index i : piece.nodes) {
      s.reference[i] += configuration.displacement[i];
    }
    const double value = imbalance(s, piece, forces_.external);
    s.reference = std::move(reference);
    return value;
  }

  ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  TangentSolver solver_;
  BlockMatrix matrix_;
  Forces forces_;
};

double least_thickness(const Model& model) {
  double least = std::numeric_limits<double>::infinity();
  for (const ShellBody& body : model.shells) {
    least = std::min(least, *std::min_element(body.thickness.begin(), body.thickness.end()));
  }
  return least;
}

/// Root mean square over the nodes.
double distance(const Configuration& a, const Configuration& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.displacement.size(); ++i) {
    sum += (a.displacement[i] - b.displacement[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(a.displacement.size()));
}

struct Failure {
  std::string found;
  std::string reason;
};

Failure why(const NewtonResult& result, const SettleResult& let_go, bool prescribed) {
  // Prescribed displacements hold a shell that loads alone would carry off: what cannot follow them has no limit load.
  const std::string limit = prescribed ? "limit point" : "limit load";
  const std::string none = "no stable static equilibrium";
  if (let_go.ran_away) {
    return {none, limit + ": beyond it there is no equilibrium, the shell yields without bound"};
  }
  if (let_go.settled) {
    return {none, limit +
                      ": beyond it the shell jumps to a distant shape (snap-through or buckling), which a dynamic run "
                      "may follow"};
  }
  if (!result.stable || let_go.lost_stability) {
    return {none,
            limit + ": the stiffness is no longer positive, and no state was found in which the shell could rest"};
  }
  return {"no static equilibrium found", result.valid ? "Newton's method does not converge, although the stiffness is "
                                                        "positive as far as it came: take more load steps"
                                                      : "elements collapse or fold"};
}

}  // namespace

Summary run_static(ShellSystem& system, const Model& model, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  Summary summary;
  LoadStep step(system, model, settings);
  Configuration configuration = reference_configuration(system);
  State state;
  double factor = 0;
  double shown = 0;
  double part = 1;
  if (resumption.from) {
    summary = resumption.from->summary;
    if (summary.stiffened_from) {
      stiffen_short_waves(system);
    }
    configuration = {resumption.from->displacement, resumption.from->rotation};
    factor = resumption.from->position;
    shown = resumption.from->memory.at("shown").at(0);
    part = resumption.from->memory.at("part").at(0);
  } else {
    summary.dof = step.freedom_count();
    state = make_state(system, model, configuration, 0);
    state.converged = true;
    on_state(state);
    summary.volume_before = state.volume;
    summary.volume_after = state.volume;
  }

  const double thickness = least_thickness(model);
  for (std::size_t s = summary.steps; s < run.load_factors.size(); ++s) {
    const auto start = Clock::now();
    const double target = run.load_factors[s];
    const double whole = target - factor;
    step.tell_direct_error(s == 0 || s + 1 == run.load_factors.size());
    std::size_t newton_iterations = 0;
    std::size_t cg_iterations = 0;
    NewtonResult result;
    while (factor != target) {
      const bool last = part * whole >= target - factor - 1e-12 * whole;
      const double next = last ? target : factor + part * whole;
      Configuration attempt = configuration;
      result = step.run(next, factor, attempt);
      newton_iterations += result.iterations;
      cg_iterations += result.cg_iterations;
      // With a fixed count of iterations, or one linearisation, nobody asks for a tolerance.
      const bool one_linearisation = settings.newton_max == 1 && result.residual <= largest_unchecked_residual;
      const bool accepted = result.converged || (result.valid && (settings.cg_fixed_count || one_linearisation));
      const bool left_the_path = result.predicted > 0 && result.reached > largest_departure * result.predicted;
      if (accepted && (settings.cg_fixed_count || (result.stable && !left_the_path))) {
        configuration = std::move(attempt);
        factor = next;
        part = std::min(1.0, 2 * part);
        continue;
      }
      part /= 2;
      if (part >= smallest_part) {
        continue;
      }
      if (!summary.stiffened_from && has_soft_waves(system)) {
        stiffen_short_waves(system);
        summary.stiffened_from = factor;
        part = 1;
        continue;
      }
      const double beyond = std::min(target, factor + 4 * smallest_part * whole);
      attempt = configuration;
      const SettleResult let_go = step.let_go(beyond, factor, thickness, attempt);
      newton_iterations += let_go.iterations;
      cg_iterations += let_go.cg_iterations;
      if (!let_go.settled || distance(attempt, configuration) > largest_branch * thickness) {
        if (factor != shown) {  // the last good state, also between two load steps
          state = make_state(system, model, configuration, factor);
          state.load_factor = factor;
          state.converged = true;
          on_state(state);
        }
        const auto [found, reason] = why(result, let_go, !system.prescribed.empty());
        throw RequirementError(
            fmt::format("{} beyond load factor {:.6g} of {:.6g} ({}): {}; the last good state is at "
                        "{:.6g}",
                        found, factor, run.load_factors.back(),
                        describe_loads(model, load_factors(model, true, factor),
                                       load_factors(model, true, run.load_factors.back())),
                        reason, factor));
      }
      configuration = std::move(attempt);
      factor = beyond;
      part = 4 * smallest_part;
      result.residual = let_go.residual;
      result.converged = true;
    }
    state = make_state(system, model, configuration, factor);
    state.load_factor = factor;
    state.residual = result.residual;
    state.newton_iterations = newton_iterations;
    state.cg_iterations = cg_iterations;
    set_algebraic_error(result.algebraic_error, state);
    state.converged = result.converged;
    record_step(state, seconds_since(start), summary);
    const bool is_last = s + 1 == run.load_factors.size();
    if ((s + 1) % settings.every == 0 || is_last) {
      on_state(state);
      shown = factor;
    }
    resumption.offer([&] {
      return Checkpoint{
          summary, factor, configuration.displacement, configuration.rotation, {{"shown", {shown}}, {"part", {part}}}};
    });
    advance(progress, static_cast<double>(s + 1) / static_cast<double>(run.load_factors.size()));
  }
  return summary;
}

Summary run_linear(ShellSystem& system, const Model& model, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  Summary summary;
  TangentSolver solver(system, settings);
  solver.tell_direct_error(true);
  const Configuration reference = reference_configuration(system);
  State state;
  if (resumption.from) {
    summary = resumption.from->summary;
  } else {
    summary.dof = solver.freedom_count();
    state = make_state(system, model, reference, 0);
    state.converged = true;
    state.linear = true;
    on_state(state);
    summary.volume_before = state.volume;
    summary.volume_after = state.volume;
  }

  BlockMatrix matrix = system.pattern;
  linear_stiffness(system, matrix);
  Forces forces;
  const std::size_t first = summary.steps;
  for (std::size_t s = first; s < run.load_factors.size(); ++s) {
    const auto start = Clock::now();
    const double factor = run.load_factors[s];
    evaluate(system, model, reference, load_factors(model, true, factor), {}, forces, nullptr);
    const VectorX held = prescribed_positions(system, model, factor);
    VectorX product;
    multiply(matrix, held, product);
    VectorX right = forces.external - product;
    mask(solver.free(), right);
    VectorX solution;
    const TangentSolver::Result solved = solver.solve(matrix, right, solution, s > first);
    if (!solved.solved || !solved.positive_definite) {
      throw RequirementError(
          "the linear stiffness is not positive definite: the model is not held, or its elements are "
          "too distorted for double precision");
    }
    VectorX displacement = solution + held;
    take_out_linear_rigid_motion(system, model, displacement);
    multiply(matrix, displacement, product);

    Configuration configuration = reference;
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      configuration.displacement[i] = displacement.segment<3>(6 * static_cast<Eigen::Index>(i));
      configuration.rotation[i] = exponential(displacement.segment<3>(6 * static_cast<Eigen::Index>(i) + 3));
    }
    VectorX unbalanced = forces.external - product;
    mask(solver.free(), unbalanced);
    const double scale = std::max(force_norm(system, forces.external), force_norm(system, product));
    state = make_state(system, model, configuration, factor);
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      state.rotation[i] = displacement.segment<3>(6 * static_cast<Eigen::Index>(i) + 3);
    }
    state.linear = true;
    state.load_factor = factor;
    state.strain_energy = 0.5 * displacement.dot(product);
    state.residual = scale > 0 ? force_norm(system, unbalanced) / scale : 0;
    state.newton_iterations = 1;
    state.cg_iterations = solved.cg_iterations;
    set_algebraic_error(solved.error, state);
    state.converged = solved.converged;
    if (!solved.converged && !settings.cg_fixed_count) {
      throw RequirementError(
          fmt::format("conjugate gradients stopped at a relative residual of {:.3g} after {} "
                      "iterations: use the direct solver or allow more iterations",
                      solved.residual, solved.cg_iterations));
    }
    record_step(state, seconds_since(start), summary);
    if ((s + 1) % settings.every == 0 || s + 1 == run.load_factors.size()) {
      on_state(state);
    }
    resumption.offer([&] { return Checkpoint{summary, factor, {}, {}, {}}; });  // no step needs the one before
    advance(progress, static_cast<double>(s + 1) / static_cast<double>(run.load_factors.size()));
  }
  return summary;
}

}  // namespace tunica
