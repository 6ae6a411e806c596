#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/detail/stepped_run.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tunica {
namespace {

constexpr double largest_turn_of_step = 0.3;  // rad in one step, by its predictor
constexpr double largest_correction = 0.5;
/// Straight lines between the states may depart from the path by this part of the largest factor and displacement.
constexpr double chord_of_factor = 0.002;
constexpr double chord_of_displacement = 0.005;
/// A step whose chord departs by this many times more is taken again, shorter.
constexpr double retry_limit = 6;
/// A state that departs from where the tangents at both ends lead, by this part of the step, lies on another path.
constexpr double other_path = 0.5;
/// Steps are not cut below this part of the path so far.
constexpr double smallest_step = 1e-6;
constexpr std::size_t wanted_iterations = 4;
constexpr std::size_t most_corrections_of_step = 10;

/// A converged state, with the tangent of the path there.
struct PathState {
  Configuration configuration;
  double factor = 0;
  VectorX direction;        ///< d (displacement, spin) / d arc length
  double factor_slope = 0;  ///< d factor / d arc length
  std::size_t negative_pivots = 0;
  double residual = 0;
  std::size_t iterations = 0;
};

/// Balance and bordered solves along lambda -> configuration. The length of an increment is the root mean square over
/// the nodes of displacements and (mean edge length x) rotations; the factor does not count.
class PathSolver {
public:
  PathSolver(const ShellSystem& system, const RunSettings& settings)
      : system_(system),
        model_(*system.model),
        settings_(settings),
        free_(free_freedoms(system)),
        matrix_(system.pattern),
        solver_(system.pattern, free_),
        prescribed_(prescribed_positions(system, 1)),
        weights_(VectorX::Zero(first_freedom(system.node_count()))) {
    const double share = 1 / real(system.node_count());
    for (std::size_t i = 0; i < system.node_count(); ++i) {
      weights_.segment<3>(first_freedom(i)).setConstant(share);
      weights_.segment<3>(first_freedom(i) + 3).setConstant(share * system.length * system.length);
    }
  }

  [[nodiscard]] std::size_t freedom_count() const { return std::count(free_.begin(), free_.end(), true); }

  /// Fills the tangent of the path at `state`, on the side of `before` (empty: the factor grows).
  /// @return false where the stiffness is singular to the last digit.
  bool find_direction(PathState& state, const VectorX& before) {
    VectorX response;
    const Balance balance = evaluate_at(state.configuration, state.factor);
    if (!balance.valid || !factor_matrix(state.negative_pivots) || !respond(state.configuration, response)) {
      return false;
    }
    const double length = std::sqrt(product(response, response));
    if (!(length > 0)) {
      throw InputError("arc length: the loads do not deform anything");
    }
    const double sign = before.size() == 0 || product(response, before) > 0 ? 1 : -1;
    state.direction = sign / length * response;
    state.factor_slope = sign / length;
    return true;
  }

  /// From `start`, with a prediction along its tangent, by Newton's method in the plane across the tangent one step
  /// ahead. @return false where that fails; `state` is then of no use.
  bool find_state(const PathState& start, double step, PathState& state) {
    const VectorX across = weights_.cwiseProduct(start.direction);
    state.configuration = start.configuration;
    VectorX change = step * start.direction;
    double factor_change = step * start.factor_slope;
    advance_configuration(system_, change, state.configuration);
    const std::size_t most = std::min(settings_.newton_max, most_corrections_of_step);
    for (state.iterations = 0;; ++state.iterations) {
      check_interrupt();
      state.factor = start.factor + factor_change;
      const Balance balance = evaluate_at(state.configuration, state.factor);
      if (!balance.valid) {
        return false;
      }
      VectorX right = balance.unbalanced;
      mask(free_, right);
      const double norm = force_norm(system_, right);
      state.residual = balance.scale > 0 ? norm / balance.scale : 0;
      const double missed = step - across.dot(change);
      const bool balanced = state.residual <= settings_.converge || norm <= balance.floor;
      if (balanced && std::abs(missed) <= 1e-9 * step) {
        return true;
      }
      if (state.iterations == most || !std::isfinite(norm)) {
        return false;
      }
      VectorX correction, response;
      std::size_t pivots = 0;
      if (!factor_matrix(pivots) || !solve(right, correction) || !respond(state.configuration, response)) {
        return false;
      }
      const double by = (missed - across.dot(correction)) / across.dot(response);
      if (!std::isfinite(by)) {
        return false;
      }
      correction += by * response;
      if (largest_rotation(system_, correction) > largest_correction) {
        return false;
      }
      change += correction;
      factor_change += by;
      advance_configuration(system_, correction, state.configuration);
    }
  }

  [[nodiscard]] double product(const VectorX& a, const VectorX& b) const { return a.dot(weights_.cwiseProduct(b)); }

private:
  Balance evaluate_at(const Configuration& configuration, double factor) {
    return static_balance(system_, configuration, factor, forces_, &matrix_);
  }

  const VectorX& external(const Configuration& configuration, double factor) {
    evaluate(system_, {configuration, std::vector<double>(model_.loads.size(), factor)}, forces_, nullptr);
    return forces_.external;
  }

  bool factor_matrix(std::size_t& negative_pivots) {
    const DirectSolver::Factored factored = solver_.factor(matrix_);
    negative_pivots = factored.negative_pivots;
    return factored.regular;
  }

  bool solve(const VectorX& right, VectorX& x) {
    solver_.solve(right, x);
    if (!x.allFinite()) {
      return false;
    }
    (void)gmres(matrix_, free_, solver_, right, x);
    return x.allFinite();
  }

  /// How displacements and spins follow the factor.
  bool respond(const Configuration& configuration, VectorX& response) {
    VectorX right = -external(configuration, 0);
    right += external(configuration, 1);
    VectorX moved;
    multiply(matrix_, prescribed_, moved);
    right -= moved;
    mask(free_, right);
    if (!solve(right, response)) {
      return false;
    }
    response += prescribed_;
    return true;
  }

  const ShellSystem& system_;
  const Model& model_;
  const RunSettings& settings_;
  FreeMask free_;
  BlockMatrix matrix_;
  DirectSolver solver_;
  VectorX prescribed_;
  VectorX weights_;
  Forces forces_;
};

/// The extreme of the factor between two states at which its slope changes sign: of the cubic through both.
double limit_factor(const PathState& a, const PathState& b, double step) {
  const double ma = a.factor_slope * step;
  const double mb = b.factor_slope * step;
  const double rise = b.factor - a.factor;
  // Slope of the Hermite cubic at t: ma + 2 c t + 3 d t^2.
  const double c = 3 * rise - 2 * ma - mb;
  const double d = ma + mb - 2 * rise;
  const double root = std::sqrt(std::max(0.0, c * c - 3 * d * ma));
  const double q = -(c + std::copysign(root, c));
  for (const double t : {q / (3 * d), ma / q}) {
    if (t >= 0 && t <= 1) {
      return a.factor + t * (ma + t * (c + t * d));
    }
  }
  return std::abs(a.factor_slope) < std::abs(b.factor_slope) ? a.factor : b.factor;
}

class PathRun final : public SteppedRun {
public:
  PathRun(ShellSystem& system, const RunSettings& settings, const ArcLengthRun& run, const StateCallback& on_state)
      : SteppedRun(system, settings, on_state, run.max_steps), run_(run), path_(system, settings) {
    const Model& model = *system.model;
    // A body under follower pressure alone may be turned as it stands.
    only_follows_ = std::all_of(model.loads.begin(), model.loads.end(), [](const Load& load) {
      const auto* pressure = std::get_if<PressureLoad>(&load.kind);
      return pressure != nullptr && pressure->follower;
    });
  }

  Summary run(const Progress& progress) {
    Summary summary = follow(progress);
    require_goal();
    if (!ended_ && run_.max_factor) {
      summary.short_of_factor = now_.factor;
    }
    return summary;
  }

private:
  State begin() override {
    summary_.dof = path_.freedom_count();
    if (has_soft_waves(system_)) {  // else the limit points could be those of the mesh
      stiffen_short_waves(system_);
      summary_.stiffened_from = 0;
    }
    now_.configuration = reference_configuration(system_);
    return reference_state();
  }

  State take_step() override {
    if (summary_.steps == 0) {
      set_out();
    }
    PathState next;
    double depart = 0;
    while (true) {
      step_ = std::min(step_, largest_turn_of_step / std::max(largest_rotation(system_, now_.direction), 1e-300));
      next = PathState();
      if (find(now_, step_, next)) {
        depart = departure(now_, next);
        if (!(depart > retry_limit)) {
          break;
        }
      }
      step_ /= 2;
      if (step_ < smallest_step * length_) {
        fail();
      }
    }
    if (const auto end = end_between(now_, next)) {
      next = end_at(now_, next, step_, *end);
      ended_ = true;
      reached_ = reached_ || !end->factor;
    }
    note_stability(now_, next, step_);
    length_ += step_;
    step_ *= growth(depart, next.iterations);
    now_ = std::move(next);
    largest_factor_ = std::max(largest_factor_, std::abs(now_.factor));
    return state_now(summary_.steps + 1);
  }

  [[nodiscard]] double part_done() const override {
    return std::max(SteppedRun::part_done(),
                    run_.max_factor ? std::min(1.0, std::abs(now_.factor) / *run_.max_factor) : 0.0);
  }

  void set_out() {
    if (!path_.find_direction(now_, {})) {
      throw RequirementError("arc length: the stiffness of the reference is singular");
    }
    stable_pivots_ = now_.negative_pivots;
    length_ = step_ = run_.first_factor / now_.factor_slope;
  }

  /// By which the next step is longer than one that departs from its chord so far, in so many iterations.
  static double growth(double depart, std::size_t iterations) {
    const double by_iterations = real(wanted_iterations) / real(std::max<std::size_t>(1, iterations));
    return std::clamp(std::min(std::sqrt(1 / std::max(depart, 1e-300)), std::sqrt(by_iterations)), 0.5, 2.0);
  }

  /// The next state, without the rigid motion of bodies that are held by it, and the tangent there.
  bool find(const PathState& from, double step, PathState& state) {
    if (!path_.find_state(from, step, state)) {
      return false;
    }
    const std::vector<Vec3> displacement = state.configuration.displacement;
    for (const Piece& piece : system_.pieces) {
      if (only_follows_ && piece.balanced) {
        take_out_rigid_motion(system_, piece, state.configuration);
      }
    }
    return path_.find_direction(state, from.direction) && leads_to(from, step, displacement, state);
  }

  /// Whether a path can lead from the one state to the other, for a plane ahead may meet others, too: its mean tangent
  /// does so to second order, it sets out towards the load, and where the factor turns a mode changes its stability.
  /// @param displacement  of the second one, with its rigid motion
  [[nodiscard]] bool leads_to(const PathState& a, double step, const std::vector<Vec3>& displacement,
                              const PathState& b) const {
    double missed = 0, moved = 0;
    for (std::size_t i = 0; i < system_.node_count(); ++i) {
      const auto slope = [&](const PathState& state) { return state.direction.segment<3>(first_freedom(i)); };
      const Vec3 led = step / 2 * (slope(a) + slope(b));
      missed += (displacement[i] - a.configuration.displacement[i] - led).squaredNorm();
      moved += std::max(slope(a).squaredNorm(), slope(b).squaredNorm()) * step * step;
    }
    const double factor_led = step / 2 * (a.factor_slope + b.factor_slope);
    const double factor_moved = step * std::max(std::abs(a.factor_slope), std::abs(b.factor_slope));
    const bool turns = a.factor_slope * b.factor_slope < 0;
    const bool sets_out = summary_.steps > 0 || b.factor > a.factor;
    return sets_out && (!turns || (a.negative_pivots + b.negative_pivots) % 2 == 1) &&
           missed <= other_path * other_path * moved &&
           std::abs(b.factor - a.factor - factor_led) <= other_path * factor_moved;
  }

  /// How far a straight line departs from the path between two states, in units of what is allowed.
  [[nodiscard]] double departure(const PathState& a, const PathState& b) const {
    const VectorX turned = b.direction - a.direction;
    const double of_displacement = std::sqrt(path_.product(turned, turned)) * step_ / 8 / length_;
    const double largest = std::max({largest_factor_, std::abs(b.factor), run_.first_factor});
    const double of_factor = std::abs(b.factor_slope - a.factor_slope) * step_ / 8 / largest;
    return std::max(of_displacement / chord_of_displacement, of_factor / chord_of_factor);
  }

  [[nodiscard]] double goal_of(const Configuration& configuration) const {
    const Probe& probe = model_.probes[run_.until->probe];
    return configuration.displacement[model_.first_node(probe.body) + probe.node][run_.until->axis];
  }

  /// What is led to its goal in the last step: a displacement of the probe, or the load factor.
  struct End {
    bool factor = false;
    double goal = 0;
  };

  [[nodiscard]] double value_of(const End& end, const PathState& state) const {
    return end.factor ? state.factor : goal_of(state.configuration);
  }

  [[nodiscard]] std::optional<End> end_between(const PathState& a, const PathState& b) const {
    if (run_.until) {
      const End end{false, run_.until->reaches};
      if ((value_of(end, a) - end.goal) * (value_of(end, b) - end.goal) <= 0) {
        return end;
      }
    }
    if (run_.max_factor && std::abs(b.factor) >= *run_.max_factor) {
      return End{true, std::copysign(*run_.max_factor, b.factor)};
    }
    return std::nullopt;
  }

  /// The end of the path itself, between a state before and one beyond it: the length of the step by the Illinois
  /// method. Where a state on the way is not found, the one beyond.
  /// @param step  becomes the length up to there
  PathState end_at(const PathState& a, const PathState& b, double& step, const End& end) {
    constexpr int most_rounds = 60;
    const auto miss = [&](const PathState& state) { return value_of(end, state) - end.goal; };
    std::array<double, 2> bound{0, step};
    std::array<double, 2> missed{miss(a), miss(b)};
    std::size_t last = 2;  // the bound that was moved last
    PathState middle = b;
    double ended = step;
    for (int round = 0; round < most_rounds && std::abs(miss(middle)) > 1e-10 * std::abs(end.goal); ++round) {
      const double length = (bound[0] * missed[1] - bound[1] * missed[0]) / (missed[1] - missed[0]);
      if (!(length > 0) || !find(a, length, middle)) {
        const bool is_there = std::abs(miss(a)) <= 1e-10 * std::abs(end.goal);
        step = is_there ? 0 : step;
        return is_there ? a : b;
      }
      ended = length;
      const std::size_t moved = (miss(middle) > 0) == (missed[1] > 0) ? 1 : 0;
      bound[moved] = length;
      missed[moved] = miss(middle);
      if (moved == last) {
        missed[1 - moved] /= 2;
      }
      last = moved;
    }
    step = ended;
    return middle;
  }

  void note_stability(const PathState& a, const PathState& b, double step) {
    const bool limit = a.factor_slope * b.factor_slope < 0;
    if (limit) {
      summary_.limit_factors.push_back(limit_factor(a, b, step));
    }
    if (passes_branch(a, b)) {
      summary_.branch_factors.push_back(branch_factor(a, b, step));
    }
    summary_.ends_unstable = b.negative_pivots > stable_pivots_;
  }

  /// Whether more modes have lost or gained stability between two states than the one that a limit point takes.
  static bool passes_branch(const PathState& a, const PathState& b) {
    const auto change = std::max(a.negative_pivots, b.negative_pivots) - std::min(a.negative_pivots, b.negative_pivots);
    return change > (a.factor_slope * b.factor_slope < 0 ? 1U : 0U);
  }

  /// Where the first of these modes does, by halving the step: the stiffness itself tells on which side a state lies.
  double branch_factor(const PathState& a, const PathState& b, double step) {
    constexpr double precise = 1e-4;  // of the largest factor: less than what the mesh leaves open
    PathState beyond = b;
    double before = a.factor, from = 0, to = step;
    const double largest = std::max({largest_factor_, std::abs(a.factor), std::abs(b.factor)});
    while (std::abs(beyond.factor - before) > precise * largest && to - from > smallest_step * step) {
      PathState middle;
      if (!find(a, (from + to) / 2, middle)) {
        break;
      }
      if (passes_branch(a, middle)) {
        to = (from + to) / 2;
        beyond = std::move(middle);
      } else {
        from = (from + to) / 2;
        before = middle.factor;
      }
    }
    return (before + beyond.factor) / 2;
  }

  [[nodiscard]] State state_now(std::size_t step) const {
    State state = make_state(system_, now_.configuration, real(step));
    state.load_factor = now_.factor;
    state.residual = now_.residual;
    state.newton_iterations = now_.iterations;
    state.converged = true;
    return state;
  }

  void require_goal() const {
    if (run_.until && !reached_) {
      const bool by_steps = summary_.steps == run_.max_steps;
      throw RequirementError(fmt::format(
          "arc length: the path ended after {} steps at load factor {:.6g}, by {}, before {} reached {:.6g} mm along "
          "{}: "
          "it is at {:.6g} mm",
          summary_.steps, now_.factor, by_steps ? "max_steps" : "max_factor", model_.probes[run_.until->probe].name,
          run_.until->reaches, "xyz"[run_.until->axis], goal_of(now_.configuration)));
    }
  }

  [[noreturn]] void fail() {
    if (shown_ != summary_.steps) {  // the last good state
      hand_over(state_now(summary_.steps));
    }
    throw RequirementError(fmt::format(
        "arc length: no state was found beyond load factor {:.6g}, after {} steps, even with steps of {:.0e} "
        "of the path: it ends there, turns sharply or folds an element; the last good state is there",
        now_.factor, summary_.steps, smallest_step));
  }

  const ArcLengthRun& run_;
  PathSolver path_;
  PathState now_;
  double step_ = 0;    ///< arc length of the next step
  double length_ = 0;  ///< of the path so far, and the first step
  bool only_follows_ = false;
  double largest_factor_ = 0;
  std::size_t stable_pivots_ = 0;  ///< negative ones of the reference: pressures of solids
  bool reached_ = false;           ///< what `until` asks for
};

}  // namespace

Summary run_arc_length(ShellSystem& system, const RunSettings& settings, const ArcLengthRun& run,
                       const StateCallback& on_state, const Progress& progress) {
  return PathRun(system, settings, run, on_state).run(progress);
}

}  // namespace tunica
