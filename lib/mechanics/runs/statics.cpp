#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/model/wall.hpp"
#include "tunica/mechanics/runs/detail/contact_steps.hpp"
#include "tunica/mechanics/runs/detail/settle.hpp"
#include "tunica/mechanics/runs/detail/stepped_run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/mechanics/runs/detail/table_turns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tunica {

VectorX prescribed_positions(const ShellSystem& system, double factor) {
  const Model& model = *system.model;
  VectorX positions = VectorX::Zero(first_freedom(system.node_count()));
  for (const PrescribedFreedom& p : system.prescribed) {
    positions[p.freedom] = p.value * factor_of(model.fixes[p.fix].ramp, true, factor);
  }
  return positions;
}

Balance static_balance(const ShellSystem& system, const Configuration& configuration, double factor, Forces& forces,
                       BlockMatrix* tangent, const std::vector<ElementState>& predicted) {
  const Model& model = *system.model;
  return balance_at(system, {configuration, load_factors(model, true, factor), &predicted}, forces, tangent);
}

namespace {

/// Smallest increment that is tried before the load counts as one without equilibrium near: this part of the whole
/// load, and of a load step.
constexpr double smallest_of_load = 1.0 / 4096;
constexpr double smallest_of_step = 1.0 / 16;
/// Turns of tables nearer to the ends of an increment than this part of a load step stand there.
constexpr double smallest_turn = 1e-12;
/// Where a path breaks off, the shell is let go this many smallest increments beyond, so that it does not come back.
constexpr double beyond_the_limit = 4;
/// A step whose change is more than this times its linear prediction has left the path: up to a limit point a quadratic
/// fold gives at most 2.
constexpr double largest_departure = 3;
/// Where nothing tells of a state of balance that is not stable, this part of the thickness tells a snap from
/// iterations that came to nothing.
constexpr double visible_jump = 0.25;
/// A configuration is near where Newton's method needs no more from there.
constexpr std::size_t near_iterations = 5;

/// One load step to equilibrium, bodies held by their rigid motions included: their mean displacement and rotation are
/// taken out, and equilibrium found again, until both hold.
class LoadStep {
public:
  LoadStep(ShellSystem& system, const RunSettings& settings)
      : system_(system), model_(*system.model), settings_(settings), by_factor_(settings), matrix_(system.pattern) {
    solver_.emplace(system, settings);
    by_factor_.solver = Solver::direct;
  }

  NewtonResult run(double factor, double previous_factor, Configuration& configuration) {
    const auto balance = [&](const Configuration& c, BlockMatrix* tangent, const std::vector<ElementState>& predicted) {
      return static_balance(system_, c, factor, forces_, tangent, predicted);
    };
    const VectorX held = still_to_move(factor, configuration);
    begin_contact(system_, settings_, previous_factor, factor, configuration, solver_, matrix_);
    // What was imaged under pressure may be there already.
    const bool likely_at_rest = system_.prestress_residual.has_value();
    // One iteration knows no tangent but that of where it began: a straight column under its load looks stable there.
    constexpr std::size_t fewest_iterations = 2;
    NewtonResult result =
        newton(system_, settings_, *solver_, balance, held, matrix_, configuration, likely_at_rest, fewest_iterations);
    // Without an iteration no tangent was made.
    if (result.converged && result.iterations > 0 && settings_.solver == Solver::cg && !settings_.cg_fixed_count) {
      result.stable = result.stable && is_positive();
    }
    const VectorX still = VectorX::Zero(held.size());
    for (int round = 0; round < 8 && result.converged; ++round) {
      bool changed = false;
      for (const Piece& piece : system_.pieces) {
        if (piece.balanced) {
          take_out_rigid_motion(system_, piece, configuration);
          changed = true;
        }
      }
      if (!changed) {
        break;
      }
      const NewtonResult again = newton(system_, settings_, *solver_, balance, still, matrix_, configuration, true);
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

  /// Where the path has lost its stability: moves what is prescribed, and lets the shell creep to where it can rest.
  /// Errors: MemoryError: with the cg solver, a factor does not fit into the memory.
  SettleResult let_go(double factor, Configuration& configuration) {
    const auto balance = [&](const Configuration& c, BlockMatrix* tangent, const std::vector<ElementState>& predicted) {
      return static_balance(system_, c, factor, forces_, tangent, predicted);
    };
    begin_contact(system_, settings_, factor, factor, configuration, solver_, matrix_);
    advance_configuration(system_, still_to_move(factor, configuration), configuration);
    if (settings_.solver != Solver::cg) {
      return settle(system_, settings_, *solver_, balance, matrix_, configuration);
    }
    TangentSolver solver(system_, by_factor_);  // iterations do not come to rest on tangents that are hardly positive
    return settle(system_, by_factor_, solver, balance, matrix_, configuration);
  }

  /// Whether nothing but the load need hold the shell in a state.
  [[nodiscard]] bool is_stable(double factor, const Configuration& configuration) {
    return static_balance(system_, configuration, factor, forces_, &matrix_).valid && is_positive();
  }

  [[nodiscard]] std::size_t freedom_count() const { return solver_->freedom_count(); }
  void tell_direct_error(bool tell) { solver_->tell_direct_error(tell); }

private:
  /// From a configuration to what is prescribed at a load factor, 6 per node. A ramp may begin with another factor than
  /// zero.
  [[nodiscard]] VectorX still_to_move(double factor, const Configuration& configuration) const {
    VectorX moved = prescribed_positions(system_, factor);
    for (const PrescribedFreedom& p : system_.prescribed) {
      moved[p.freedom] -= configuration.displacement[p.freedom / 6][narrow<Eigen::Index>(p.freedom % 6)];
    }
    return moved;
  }

  /// Of the last tangent. One of what slides is unsymmetric, and says nothing; nor does one whose factor does not fit
  /// into the memory.
  [[nodiscard]] bool is_positive() {
    try {
      return system_.law().slides() || solver_->is_positive_definite(matrix_);
    } catch (const MemoryError&) {
      return true;
    }
  }

  void require_balance(const Configuration& configuration, double factor) {
    static_balance(system_, configuration, factor, forces_, nullptr);
    for (const Piece& piece : system_.pieces) {
      if (piece.balanced && imbalance_of(piece, configuration) > largest_imbalance) {
        throw RequirementError(
            fmt::format("{}: at load factor {:.6g} the loads are no longer in balance on the deformed body, which only "
                        "its rigid motions hold: hold it by a [[fix]]",
                        model_.name_of(piece.body), factor));
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
  RunSettings by_factor_;  ///< the same with the direct solver
  std::optional<TangentSolver> solver_;
  BlockMatrix matrix_;
  Forces forces_;
};

double largest_distance(const Configuration& a, const Configuration& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.displacement.size(); ++i) {
    largest = std::max(largest, (a.displacement[i] - b.displacement[i]).norm());
  }
  return largest;
}

struct Failure {
  std::string found;
  std::string reason;
};

/// @param loose  the body that nothing holds, if any
Failure why(const NewtonResult& result, const SettleResult& let_go, bool prescribed, const std::string& loose) {
  // Prescribed displacements hold a shell that loads alone would carry off: what cannot follow them has no limit load.
  const std::string limit = prescribed ? "limit point" : "limit load";
  const std::string none = "no stable static equilibrium";
  if (!loose.empty()) {
    return {none, fmt::format("nothing but contact could hold {}, and it does not: hold it by a fix, or place it so "
                              "that what it touches stops it",
                              loose)};
  }
  if (!result.apart) {
    return {"no state found that bodies can reach without passing through each other", "take more load steps"};
  }
  if (let_go.ran_away) {
    return {none, limit + ": no equilibrium was found beyond it, the shell yields without bound"};
  }
  if (!result.stable || let_go.lost_stability) {
    return {none,
            limit + ": the stiffness is no longer positive, and no state was found in which the shell could rest"};
  }
  return {"no static equilibrium found", result.valid ? "Newton's method does not converge, although the stiffness is "
                                                        "positive as far as it came: take more load steps"
                                                      : "elements collapse or fold"};
}

/// What load control does: the load grows to one load factor after the other, each in one step, which is cut only where
/// a table of the scene turns, and where Newton's method fails. Where the path of equilibria breaks off, the shell goes
/// on from the state of rest that it then finds.
class LoadControl final : public SteppedRun {
public:
  LoadControl(ShellSystem& system, const RunSettings& settings, const StaticRun& run, const StateCallback& on_state,
              const std::optional<Checkpoint>& near)
      : SteppedRun(system, settings, on_state, run.load_factors.size()),
        run_(run),
        near_(near),
        step_(system, settings),
        thickness_(model_.shells.empty() ? system.length : least_thickness(model_)),
        turns_(model_),
        configuration_(reference_configuration(system)) {}

private:
  State begin() override {
    summary_.dof = step_.freedom_count();
    return reference_state();
  }

  void resume(const Checkpoint& from) override {
    configuration_ = recall(from);
    factor_ = from.position;
    increment_ = from.increment;
  }

  State take_step() override {
    step_.tell_direct_error(summary_.steps == 0 || is_last());
    const double target = run_.load_factors[summary_.steps];
    if (near_ && summary_.steps == 0) {
      if (const auto found = from_near(target)) {
        return state_of(*found);
      }
    }
    const NewtonResult reached = reach(target);
    // Who asks for a number of iterations gets it, and what they have led to.
    if (is_last() && (settings_.cg_fixed_count || settings_.newton_max == 1)) {
      summary_.ends_unstable = !step_.is_stable(factor_, configuration_);
    }
    return state_of(reached);
  }

  [[nodiscard]] Checkpoint checkpoint() const override {
    Checkpoint now = keep(factor_, configuration_);
    now.increment = increment_;
    return now;
  }

  /// Equilibrium from the configuration that is said to be near, supports and prescribed displacements put right.
  std::optional<NewtonResult> from_near(double target) {
    Configuration attempt{near_->displacement, near_->rotation};
    VectorX moved(first_freedom(system_.node_count()));
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      moved.segment<3>(first_freedom(i)) = attempt.displacement[i];
      moved.segment<3>(first_freedom(i) + 3) = logarithm(attempt.rotation[i]);
    }
    mask(free_freedoms(system_), moved);
    moved += prescribed_positions(system_, target);
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      attempt.displacement[i] = moved.segment<3>(first_freedom(i));
      attempt.rotation[i] = exponential(moved.segment<3>(first_freedom(i) + 3));
    }
    RunSettings few = settings_;
    few.newton_max = std::min(settings_.newton_max, near_iterations);
    LoadStep step(system_, few);
    step.tell_direct_error(true);
    NewtonResult result = step.run(target, target, attempt);
    if (!result.converged || !may_stand(result)) {
      return std::nullopt;
    }
    configuration_ = std::move(attempt);
    accept_contact(system_, configuration_);
    factor_ = target;
    return result;
  }

  /// Equilibrium at a load factor. Errors: RequirementError: there is none.
  /// @return of the last increment, with the iterations of all
  NewtonResult reach(double target) {
    const double step = target - factor_;
    const double smallest = std::min(smallest_of_load * run_.load_factors.back(), smallest_of_step * step);
    NewtonResult result;
    std::size_t iterations = 0;
    std::size_t cg_iterations = 0;
    double leap = 1;  // by which the next time goes farther, where the shell was let go again and again
    while (factor_ != target) {
      const double before = factor_;
      const double end = turns_.next(factor_, target, smallest_turn * step);
      const double next = increment_ >= end - factor_ - 1e-12 * step ? end : factor_ + increment_;
      Configuration attempt = configuration_;
      result = step_.run(next, factor_, attempt);
      iterations += result.iterations;
      cg_iterations += result.cg_iterations;
      result.apart = !may_stand(result) || is_apart(attempt);
      if (may_stand(result) && result.apart) {
        configuration_ = std::move(attempt);
        accept_contact(system_, configuration_);
        factor_ = next;
        increment_ *= 2;
        leap = std::max(leap / 2, 1.0);
        continue;
      }
      tell_slow_step(iterations, fmt::format("load factor {:.6g} of {:.6g}", factor_, run_.load_factors.back()),
                     why_short(result, next - before) + place_of_yielding(attempt));
      increment_ = (next - before) / 2;
      if (increment_ >= smallest) {
        continue;
      }
      if (!summary_.stiffened_from && has_soft_waves(system_)) {
        stiffen_short_waves(system_);
        summary_.stiffened_from = factor_;
        increment_ = step;
        continue;
      }
      const double past = leap * beyond_the_limit * smallest;
      const SettleResult settled = leave_path(std::min(end, factor_ + past), result);
      iterations += settled.iterations;
      cg_iterations += settled.cg_iterations;
      result.residual = settled.residual;
      result.converged = true;
      increment_ = past;
      leap *= 2;
    }
    result.iterations = iterations;
    result.cg_iterations = cg_iterations;
    return result;
  }

  /// Of an attempt that came to nothing.
  [[nodiscard]] std::string why_short(const NewtonResult& result, double part) const {
    return fmt::format("in a part of {:.3g} {}", part,
                       !result.apart       ? "bodies would pass through each other"
                       : !result.valid     ? "bodies would overlap, or elements fold"
                       : !result.converged ? "Newton's method does not come to rest"
                       : !result.stable    ? "the stiffness is not positive"
                                           : "the shell leaves its path");
  }

  [[nodiscard]] bool is_apart(const Configuration& attempt) const {
    return !system_.contact || system_.contact->is_certain(attempt);
  }

  [[nodiscard]] bool may_stand(const NewtonResult& result) const {
    // With a fixed count of iterations, or one linearisation, nobody asks for a tolerance.
    if (settings_.cg_fixed_count) {
      return result.valid;
    }
    const bool one_linearisation = settings_.newton_max == 1 && result.residual <= largest_unchecked_residual;
    const bool left_the_path =
        !system_.contact && result.predicted > 0 && result.reached > largest_departure * result.predicted;
    return (result.converged || (result.valid && one_linearisation)) && result.stable && !left_the_path;
  }

  /// From where the path breaks off to the next state of rest, at a load factor beyond. Errors: RequirementError: none.
  SettleResult leave_path(double beyond, const NewtonResult& failed) {
    Configuration attempt = configuration_;
    NewtonResult told = failed;
    SettleResult settled;
    try {
      settled = step_.let_go(beyond, attempt);
    } catch (const MemoryError&) {
      fail(told, {}, "", place_of_yielding(attempt));
    }
    told.apart = failed.apart && (!settled.settled || is_apart(attempt));
    if (!settled.settled || !told.apart) {
      fail(told, settled, settled.ran_away ? loose_body(attempt) : "", place_of_yielding(attempt));
    }
    const double moved = largest_distance(attempt, configuration_);
    const bool unstable = !failed.stable || settled.lost_stability;
    if (settled.pushed_off || (unstable && moved > visible_jump * thickness_)) {
      note_snap(moved);
    }
    configuration_ = std::move(attempt);
    accept_contact(system_, configuration_);
    factor_ = beyond;
    return settled;
  }

  /// Where a path has branched off, the stability of what branches is lost and found again while the load grows on: all
  /// that is one event.
  void note_snap(double distance) {
    std::vector<Snap>& snaps = summary_.snaps;
    if (snaps.empty() || factor_ > snaps.back().load_factor + smallest_of_step * run_.load_factors.back()) {
      snaps.push_back({factor_, 0});
    }
    snaps.back().distance = std::max(snaps.back().distance, distance);
  }

  /// Whose node has moved farthest, if its supports leave a rigid motion free.
  [[nodiscard]] std::string loose_body(const Configuration& ended) const {
    const auto& u = ended.displacement;
    const auto farthest = std::max_element(
        u.begin(), u.end(), [](const Vec3& a, const Vec3& b) { return a.squaredNorm() < b.squaredNorm(); });
    const auto node = narrow<Index>(farthest - u.begin());
    for (const Piece& piece : system_.pieces) {
      if (std::find(piece.nodes.begin(), piece.nodes.end(), node) != piece.nodes.end()) {
        return !piece.balanced && free_rigid_motions(system_, piece) > 0 ? model_.name_of(piece.body) : "";
      }
    }
    return "";
  }

  /// Where bodies were closest; where nothing is near, which node has moved most since the last state of rest.
  [[nodiscard]] std::string place_of_yielding(const Configuration& ended) const {
    if (const std::string closest = system_.contact ? system_.contact->closest_place() : ""; !closest.empty()) {
      return closest;
    }
    std::size_t most = 0;
    const auto moved = [&](std::size_t i) {
      return (ended.displacement[i] - configuration_.displacement[i]).squaredNorm();
    };
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      most = moved(i) > moved(most) ? i : most;
    }
    const Vec3 at = system_.reference[most] + configuration_.displacement[most];
    return fmt::format("; it yields most at ({:.4g}, {:.4g}, {:.4g}) mm", at.x(), at.y(), at.z());
  }

  [[noreturn]] void fail(const NewtonResult& failed, const SettleResult& let_go, const std::string& loose,
                         const std::string& place) {
    if (system_.contact) {
      system_.contact->go_back();
    }
    if (factor_ != (shown_ == 0 ? 0 : run_.load_factors[shown_ - 1])) {  // the last good state, also within a step
      NewtonResult good;
      good.converged = true;
      hand_over(state_of(good));
    }
    const double last = run_.load_factors.back();
    const auto [found, reason] = why(failed, let_go, !system_.prescribed.empty(), loose);
    throw RequirementError(fmt::format(
        "{} beyond load factor {:.6g} of {:.6g} ({}): {}{}; the last good state is at {:.6g}{}", found, factor_, last,
        describe_loads(model_, load_factors(model_, true, factor_), load_factors(model_, true, last)), reason, place,
        factor_, loose.empty() ? remedy_of_failure(model_, load_factors(model_, true, factor_)) : ""));
  }

  [[nodiscard]] State state_of(const NewtonResult& result) const {
    State state = make_state(system_, configuration_, factor_);
    state.load_factor = factor_;
    state.residual = result.residual;
    state.newton_iterations = result.iterations;
    state.cg_iterations = result.cg_iterations;
    set_algebraic_error(result.algebraic_error, state);
    state.converged = result.converged;
    return state;
  }

  const StaticRun& run_;
  const std::optional<Checkpoint>& near_;
  LoadStep step_;
  const double thickness_;
  const TableTurns turns_;
  Configuration configuration_;
  double factor_ = 0;
  double increment_ = infinity;  ///< of the load factor, to be tried next
};

}  // namespace

Summary run_static(ShellSystem& system, const RunSettings& settings, const StaticRun& run,
                   const StateCallback& on_state, const Progress& progress, const Resumption& resumption) {
  return LoadControl(system, settings, run, on_state, resumption.near).follow(progress, resumption);
}

}  // namespace tunica
