#include "tunica/mechanics/runs/detail/newton.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/mechanics/elements/rotation.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double largest_turn = 0.5;           // rad per iteration
constexpr std::size_t free_iterations = 6;     // full steps before the line search sets in
constexpr double round_off_of_length = 1e-11;  // of the model's longest side
constexpr double round_off_of_nothing = 0.01;  // of the floor, where no load acts
constexpr double near_balance = 0.1;           // residual from which forces that may jump mean something
constexpr double largest_residual_at_kinks = 1e-4;
constexpr double canceled = 0.3;        // by the mean of both sides of a kink, of the residual
constexpr double largest_swing = 1e-3;  // of the law's resolution, by the last two increments
constexpr std::size_t sides = 4;        // of a kink, or of several, that are looked at together
constexpr int most_cuts = 6;            // of an increment
constexpr int most_cuts_of_jumps = 20;  // likewise: surfaces come near each other from far away

bool uses_cg(const RunSettings& settings) { return settings.solver == Solver::cg; }

/// Where forces jump, as at the next face that something touches, a state of rest may lie on the kink, and Newton's
/// method swings from one side to the other. There it is at rest where some mean of the sides' unbalanced forces
/// vanishes. Source: Goldstein 1977, "Optimization of Lipschitz continuous functions" (the convex hull of nearby
/// gradients).
class Sides {
public:
  void look(VectorX unbalanced) {
    if (seen_.size() == sides) {
      seen_.erase(seen_.begin());
    }
    seen_.push_back(std::move(unbalanced));
    mean_ = least_mean();
  }

  /// The law is another from here.
  void forget() {
    seen_.clear();
    mean_.resize(0);
  }

  /// The weighted mean of the last sides that is nearest to zero; of size zero where none is known.
  [[nodiscard]] const VectorX& mean() const { return mean_; }

  /// An increment is expected to mend the mean, on all sides.
  void mend() {
    for (VectorX& side : seen_) {
      side -= mean_;
    }
  }

private:
  /// By Frank and Wolfe's method with exact line searches.
  [[nodiscard]] VectorX least_mean() const {
    constexpr int iterations = 100;
    VectorX mean = seen_.back();
    for (int k = 0; k < iterations; ++k) {
      const auto farthest = std::min_element(
          seen_.begin(), seen_.end(), [&](const VectorX& a, const VectorX& b) { return a.dot(mean) < b.dot(mean); });
      const VectorX way = *farthest - mean;
      const double gain = -way.dot(mean);
      if (!(gain > 1e-12 * mean.squaredNorm())) {
        break;
      }
      mean += std::min(1.0, gain / way.squaredNorm()) * way;
    }
    return mean;
  }

  std::vector<VectorX> seen_;
  VectorX mean_;
};

}  // namespace

FreeMask free_freedoms(const ShellSystem& system) {
  FreeMask free = system.held;
  free.flip();
  return free;
}

TangentSolver::TangentSolver(const ShellSystem& system, const RunSettings& settings)
    : settings_(settings), free_(free_freedoms(system)) {
  for (std::size_t i = system.first_solid_node; i < system.node_count(); ++i) {
    pressures_ += free_[freedom(i, 3)] ? 1 : 0;
  }
}

std::size_t TangentSolver::freedom_count() const { return std::count(free_.begin(), free_.end(), true); }

TangentSolver::Result TangentSolver::solve(BlockMatrix& matrix, const VectorX& b, VectorX& x, bool same_matrix) {
  Result result;
  if (freedom_count() == 0) {
    x.setZero(b.size());
    return {true, true, true, 0, 0, AlgebraicError{}};
  }
  if (uses_cg(settings_)) {
    symmetrise(matrix);
    const CgOptions options{settings_.cg_tolerance, settings_.cg_iterations, settings_.cg_fixed_count};
    const CgResult cg = conjugate_gradients(matrix, free_, b, options, x);
    result.solved = x.allFinite();
    result.converged = cg.converged;
    result.positive_definite = !cg.negative_curvature;
    result.residual = cg.residual;
    result.cg_iterations = cg.iterations;
    result.error = cg.error;
    return result;
  }
  if (!same_matrix) {
    factor(matrix);
  }
  if (!factored_.regular) {
    return result;
  }
  result.positive_definite = factored_.negative_pivots == pressures_;
  direct_->solve(b, x);
  if (!x.allFinite()) {
    return result;
  }
  result.residual = gmres(matrix, free_, *direct_, b, x);
  result.solved = x.allFinite();
  result.converged = result.solved;
  if (tell_direct_error_ && result.solved && result.positive_definite) {
    result.error = error_by_factor(matrix, free_, *direct_, b, x);
  }
  return result;
}

bool TangentSolver::is_positive_definite(const BlockMatrix& matrix) {
  if (freedom_count() == 0) {
    return true;
  }
  factor(matrix);
  return factored_.regular && factored_.negative_pivots == pressures_;
}

void TangentSolver::factor(const BlockMatrix& matrix) {
  if (!direct_) {
    direct_.emplace(matrix, free_);
  }
  factored_ = direct_->factor(matrix);
}

Balance balance_at(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) {
  evaluate(system, at, forces, tangent);
  Balance balance;
  balance.valid = forces.valid;
  balance.unbalanced = forces.external - forces.internal - forces.inertia;
  VectorX reactions = forces.internal + forces.inertia;
  mask(system.held, reactions);
  balance.scale = std::max(
      {force_norm(system, forces.external), force_norm(system, forces.inertia), force_norm(system, reactions)});
  balance.floor = round_off(system, at.configuration) + forces.noise;
  condense(system, at.configuration, balance.unbalanced, tangent);
  return balance;
}

double largest_shift(const VectorX& increment) {
  double largest = 0;
  for (Eigen::Index i = 0; i < increment.size(); i += 6) {
    largest = std::max(largest, increment.segment<3>(i).squaredNorm());
  }
  return std::sqrt(largest);
}

double increment_size(const ShellSystem& system, const VectorX& increment) {
  double sum = 0;
  for (Eigen::Index i = 0; i < increment.size(); i += 6) {
    sum += increment.segment<3>(i).squaredNorm() +
           system.length * system.length * increment.segment<3>(i + 3).squaredNorm();
  }
  return std::sqrt(sum / (real(increment.size()) / 6));
}

namespace {

/// One call of newton().
class NewtonIteration {
public:
  NewtonIteration(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                  const BalanceFunction& balance, const VectorX& held_increment, BlockMatrix& matrix,
                  Configuration& configuration, std::size_t fewest_iterations)
      : system_(system),
        law_(system.law()),
        settings_(settings),
        solver_(solver),
        balance_(balance),
        held_increment_(held_increment),
        matrix_(matrix),
        configuration_(configuration),
        fewest_iterations_(fewest_iterations),
        left_(held_increment.squaredNorm() > 0 ? 1 : 0),
        whole_(VectorX::Zero(held_increment.size())) {}

  NewtonResult run(bool likely_at_rest) {
    likely_at_rest = likely_at_rest || law_.may_change();
    now_ = balance_(configuration_, likely_at_rest ? nullptr : &matrix_, {});
    tangent_is_current_ = !likely_at_rest;
    if (!now_.valid) {
      return result_;
    }
    result_.valid = result_.stable = result_.linear_converged = true;
    result_.residual = residual_of(now_);
    result_.converged = !is_moving() && (nothing_acts() || result_.residual <= settings_.converge) && !sharpened();
    while (!result_.converged && result_.valid && result_.iterations < settings_.newton_max) {
      check_interrupt();
      const bool at_floor = result_.iterations > 0 && is_at_floor();
      result_.valid = find_increment();
      // What is left of the increments there is noise: told, but not added.
      result_.converged = result_.valid && at_floor && !is_moving() && increment_size(system_, increment_) <= noise();
      if (result_.valid && !result_.converged) {
        result_.valid = advance();
        result_.converged = result_.valid && at_rest();
      }
      if (result_.converged && sharpened()) {
        result_.converged = false;
      }
    }
    return result_;
  }

private:
  /// The law is another from here.
  bool sharpened() {
    if (!law_.sharpen()) {
      return false;
    }
    sides_.forget();
    now_ = balance_(configuration_, nullptr, {});
    tangent_is_current_ = false;
    result_.residual = residual_of(now_);
    return true;
  }

  /// Prescribed displacements or rigid bodies have not come to the end of the step.
  [[nodiscard]] bool is_moving() const { return left_ > 0 || law_.left() > 0; }

  [[nodiscard]] double residual_of(const Balance& balance) const {
    VectorX free = balance.unbalanced;
    mask(solver_.free(), free);
    const double norm = force_norm(system_, free);
    return balance.scale > 0 ? norm / balance.scale : (norm > 0 ? 1.0 : 0.0);
  }

  /// Nothing, or before a first touch nothing but round-off.
  [[nodiscard]] bool nothing_acts() const {
    return now_.scale == 0 || (law_.may_change() && now_.scale <= round_off_of_nothing * now_.floor);
  }

  /// Increments that say nothing where the residual is round-off; also of a step in which nothing changes.
  [[nodiscard]] double noise() const {
    return std::max(largest_round_off * result_.reached, round_off_of_length * longest_side(system_));
  }

  [[nodiscard]] bool is_at_floor() const { return result_.residual * now_.scale <= now_.floor; }

  /// At the floor of round-off a residual says nothing about the error any more; the increments still do.
  [[nodiscard]] bool at_rest() {
    if (is_moving() || result_.iterations < std::min(fewest_iterations_, settings_.newton_max)) {
      return false;
    }
    return result_.residual <= settings_.converge || nothing_acts() || (is_at_floor() && last_size_ <= noise()) ||
           is_settled() || swings_at_kinks();
  }

  /// The last sides cancel for the most part.
  [[nodiscard]] bool is_on_kink() const { return between_sides() <= canceled * result_.residual; }

  /// The residual of what the last sides of a kink have in common.
  [[nodiscard]] double between_sides() const {
    return sides_.mean().size() > 0 && now_.scale > 0 ? force_norm(system_, sides_.mean()) / now_.scale : infinity;
  }

  /// At rest on a kink: the last increments move next to nothing.
  [[nodiscard]] bool swings_at_kinks() {
    if (!is_on_kink() || between_sides() > largest_residual_at_kinks || !result_.stable || !is_small(last_shift_) ||
        !is_small(previous_shift_)) {
      return false;
    }
    result_.residual = std::min(result_.residual, between_sides());
    return true;
  }

  [[nodiscard]] bool is_small(double shift) const { return shift <= largest_swing * law_.resolution(); }

  /// Whether an increment leads back to where the last one came from.
  [[nodiscard]] bool turns_back() const {
    constexpr double back = -0.7, as_far = 0.3;
    const double both = increment_.norm() * last_.norm();
    return last_.size() > 0 && increment_.dot(last_) < back * both && increment_.norm() > as_far * last_.norm();
  }

  /// What is left after an increment this small is smaller still: its square, or by the tolerance of the linear solver.
  [[nodiscard]] bool is_settled() const {
    if (!(settings_.settled > 0 && result_.stable && result_.linear_converged)) {
      return false;
    }
    double sum = 0;
    for (std::size_t i = 0; i < configuration_.displacement.size(); ++i) {
      sum += configuration_.displacement[i].squaredNorm() +
             system_.length * system_.length * logarithm(configuration_.rotation[i]).squaredNorm();
    }
    return last_size_ <= settings_.settled * std::sqrt(sum / real(configuration_.displacement.size()));
  }

  /// Forces and tangent at the configuration.
  Balance linearised() {
    if (last_.size() == 0) {
      return balance_(configuration_, &matrix_, {});
    }
    VectorX all = last_;
    expand_carried(system_.carried, system_.surfaces, system_.reference, before_, all);
    if (result_.residual < near_balance && law_.harden()) {
      sides_.forget();
    }
    law_.predict(all);
    return balance_(configuration_, &matrix_, predicted_deformations(system_, before_, all));
  }

  /// By the tangent; prescribed displacements move in the first. @return false where there is no solution.
  bool find_increment() {
    if (!tangent_is_current_) {
      now_ = linearised();
    }
    VectorX right = now_.unbalanced;
    if (left_ > 0) {
      VectorX product;
      multiply(matrix_, left_ * held_increment_, product);
      right -= product;
    }
    mask(solver_.free(), right);
    // Near enough to a kink, what both sides have in common is left to be mended.
    const bool on_kink = is_on_kink() && !is_moving();
    const bool by_mean = on_kink && is_small(last_shift_);
    if (by_mean) {
      right = sides_.mean();
      sides_.mend();
    }
    const TangentSolver::Result solved = solver_.solve(matrix_, right, increment_);
    result_.cg_iterations += solved.cg_iterations;
    result_.stable = solved.positive_definite || law_.slides();
    result_.linear_converged = solved.converged;
    result_.algebraic_error = solved.error;
    if (solved.error) {
      largest_solution_ = std::max(largest_solution_, solved.error->solution);
      result_.algebraic_error->solution = largest_solution_;
    }
    ++result_.iterations;
    if (!solved.solved || (law_.may_change() && increment_size(system_, increment_) > longest_side(system_))) {
      return false;  // nothing holds some body
    }
    work_ = right.dot(increment_);
    longest_ = !on_kink || by_mean ? 1 : turns_back() ? length_ / 2 : length_;
    const double turn = largest_rotation(system_, increment_);
    if (left_ > 0) {
      increment_ += left_ * held_increment_;
    } else if (turn > largest_turn && is_moving()) {
      longest_ = largest_turn / turn;
    } else if (turn > largest_turn) {
      increment_ *= largest_turn / turn;
    }
    if (result_.iterations == 1) {
      result_.predicted = increment_size(system_, increment_);
    }
    return true;
  }

  /// Along the increment, as far as the line search says. @return false where the state there cannot be used.
  bool advance() {
    // Where another iteration will follow, judged by quadratic convergence, its tangent is made with the forces.
    const double expected =
        result_.iterations > 1 ? std::pow(result_.residual, 3) / (previous_residual_ * previous_residual_) : 1;
    const bool more = result_.iterations < settings_.newton_max && expected > settings_.converge;
    previous_residual_ = result_.residual;
    before_ = configuration_;
    double length = longest_;
    const double bodies_left = law_.left();
    const int most_trials = law_.may_change() ? most_cuts_of_jumps : most_cuts;
    for (int trial = 0;; ++trial) {
      configuration_ = before_;
      last_ = length * increment_;
      advance_configuration(system_, last_, configuration_);
      law_.set_left(bodies_left * (1 - length));
      tangent_is_current_ = more && trial == 0;
      now_ = tangent_is_current_ ? linearised() : balance_(configuration_, nullptr, {});
      if ((left_ > 0 && !law_.may_change()) || trial == most_trials) {
        break;
      }
      if (!now_.valid) {
        length /= 2;
        continue;
      }
      if (result_.iterations <= free_iterations || law_.may_change()) {
        break;
      }
      VectorX free = now_.unbalanced;
      mask(solver_.free(), free);
      const double left = free.dot(increment_);
      if (std::abs(left) <= 0.8 * std::abs(work_) || work_ <= 0) {
        break;
      }
      length = std::clamp(length * work_ / (work_ - left), 0.2 * length, 0.7 * length);
    }
    left_ = length == 1 ? 0 : left_ * (1 - length);
    length_ = length;
    whole_ += last_;
    last_size_ = increment_size(system_, last_);
    previous_shift_ = last_shift_;
    last_shift_ = largest_shift(last_);
    result_.reached = increment_size(system_, whole_);
    if (now_.valid) {
      result_.residual = residual_of(now_);
    }
    if (now_.valid && law_.has_kinks()) {
      VectorX free = now_.unbalanced;
      mask(solver_.free(), free);
      sides_.look(std::move(free));
    }
    return now_.valid && std::isfinite(result_.residual);
  }

  const ShellSystem& system_;
  ChangingLaw& law_;
  const RunSettings& settings_;
  TangentSolver& solver_;
  const BalanceFunction& balance_;
  const VectorX& held_increment_;
  BlockMatrix& matrix_;
  Configuration& configuration_;
  std::size_t fewest_iterations_;
  NewtonResult result_;
  Balance now_;
  double left_;         ///< of the prescribed displacements, still to be moved
  double longest_ = 1;  ///< part of the increment that may be followed
  double length_ = 1;   ///< part of the last one that was
  bool tangent_is_current_ = false;
  VectorX increment_;
  Configuration before_;              ///< the last increment went from here
  VectorX last_;                      ///< the last increment, as far as it was followed
  VectorX whole_;                     ///< the sum of all increments
  double work_ = 0;                   ///< of the unbalanced forces along the increment
  double last_size_ = 0;              ///< of the last increment
  double last_shift_ = infinity;      ///< mm, of the node that it moved farthest
  double previous_shift_ = infinity;  ///< by the one before
  Sides sides_;
  double largest_solution_ = 0;
  double previous_residual_ = 0;
};

}  // namespace

NewtonResult newton(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, const VectorX& held_increment, BlockMatrix& matrix,
                    Configuration& configuration, bool likely_at_rest, std::size_t fewest_iterations) {
  return NewtonIteration(system, settings, solver, balance, held_increment, matrix, configuration, fewest_iterations)
      .run(likely_at_rest);
}

}  // namespace tunica
