#include "tunica/mechanics/runs/detail/settle.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/model/wall.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t most_settling_iterations = 400;
constexpr std::size_t most_iterations_of_step = 6;
// Viscosities: parts of the stiffness against moving one node alone.
constexpr double first_viscosity = 1e-3;
constexpr double least_viscosity = 1e-16;  // less is none: round-off of the stiffness
constexpr double largest_viscosity = 1e6;
constexpr double more = 4;                               // after a step that was not found
constexpr double largest_settling_turn = 0.3;            // rad per iteration
constexpr double small_push = 0.01, largest_push = 0.5;  // of the thickness
constexpr double loose = 0.01;                           // part of the driving forces that a step may leave
constexpr double falls = 0.5;                            // what is left, in each iteration
/// Of the work of the driving forces along a step that the forces at its end may do against it.
constexpr double largest_push_back = 0.5;

/// The diagonal of the linear stiffness, one value per node for displacements and one for spins.
VectorX viscous_diagonal(const ShellSystem& system) {
  BlockMatrix stiffness = system.pattern;
  linear_stiffness(system, stiffness);
  VectorX diagonal(first_freedom(system.node_count()));
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    const auto block = stiffness.block(stiffness.find(narrow<Index>(i), narrow<Index>(i)));
    diagonal.segment<3>(first_freedom(i)).setConstant(block.diagonal().head<3>().mean());
    // A pressure is no place that could creep.
    diagonal.segment<3>(first_freedom(i) + 3)
        .setConstant(i < system.first_solid_node ? block.diagonal().tail<3>().mean() : 0.0);
  }
  return diagonal;
}

void add_diagonal(double factor, const VectorX& diagonal, BlockMatrix& matrix) {
  for (std::size_t i = 0; i < matrix.node_count(); ++i) {
    auto block = matrix.block(matrix.find(narrow<Index>(i), narrow<Index>(i)));
    block.diagonal() += factor * diagonal.segment<6>(first_freedom(i));
  }
}

double largest_displacement(const Configuration& configuration) {
  double largest = 0;
  for (const Vec3& u : configuration.displacement) {
    largest = std::max(largest, u.norm());
  }
  return largest;
}

/// From one configuration to another, 6 per node.
VectorX change_of(const Configuration& from, const Configuration& to) {
  VectorX change(first_freedom(from.displacement.size()));
  for (std::size_t i = 0; i < from.displacement.size(); ++i) {
    change.segment<3>(first_freedom(i)) = to.displacement[i] - from.displacement[i];
    change.segment<3>(first_freedom(i) + 3) = logarithm(to.rotation[i] * from.rotation[i].conjugate());
  }
  return change;
}

/// Shortens an increment that turns or moves a node too far for one step.
void limit(const ShellSystem& system, VectorX& increment) {
  const double turn = largest_rotation(system, increment);
  const double move = largest_shift(increment);
  increment *= std::min(
      {1.0, largest_settling_turn / std::max(turn, largest_settling_turn), system.length / std::max(move, 1e-300)});
}

/// One call of settle().
class Descent {
public:
  Descent(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver, const BalanceFunction& balance,
          BlockMatrix& matrix, Configuration& configuration)
      : system_(system),
        settings_(settings),
        solver_(solver),
        balance_(balance),
        thickness_(system.model->shells.empty() ? system.length : least_thickness(*system.model)),
        push_(small_push * thickness_),
        matrix_(matrix),
        configuration_(configuration),
        diagonal_(viscous_diagonal(system)),
        says_nothing_(system.law().slides()) {}

  SettleResult run() {
    const double bound = longest_side(system_);
    while (result_.iterations < most_settling_iterations && viscosity_ <= largest_viscosity) {
      check_interrupt();
      if (in_balance()) {
        if (says_nothing_ || solver_.is_positive_definite(matrix_)) {
          result_.settled = true;
          break;
        }
        result_.lost_stability = result_.pushed_off = true;
        if (!push_off()) {
          break;
        }
        (void)in_balance();
      }
      if (!now_.valid) {
        break;
      }
      const std::size_t before = result_.iterations;
      const bool found = step();
      // A tenth after one or two iterations, about a half after four.
      const double less = std::max(0.1, 1 - 1.8 / real(result_.iterations - before));
      viscosity_ = found ? std::max(less * viscosity_, least_viscosity) : more * viscosity_;
      if (largest_displacement(configuration_) > bound) {
        result_.ran_away = true;
        break;
      }
    }
    return result_;
  }

private:
  /// Also makes the tangent.
  bool in_balance() {
    do {
      now_ = balance_(configuration_, &matrix_, {});
      VectorX free = now_.unbalanced;
      mask(solver_.free(), free);
      const double norm = force_norm(system_, free);
      result_.residual = now_.scale > 0 ? norm / now_.scale : 0;
      if (!now_.valid || !(result_.residual <= settings_.converge || norm <= now_.floor)) {
        return false;
      }
    } while (system_.law().sharpen());
    return true;
  }

  /// Off a state of balance that is not stable, along the direction in which it is least so: by inverse iteration on
  /// the stiffness with as much viscosity as makes it positive. @return false where there is no such direction
  bool push_off() {
    constexpr int iterations = 6;
    constexpr double next = 16;
    BlockMatrix shifted = matrix_;
    viscosity_ = least_viscosity;
    add_diagonal(viscosity_, diagonal_, shifted);
    while (!solver_.is_positive_definite(shifted)) {
      add_diagonal((next - 1) * viscosity_, diagonal_, shifted);
      viscosity_ *= next;
      if (viscosity_ > largest_viscosity) {
        return false;
      }
    }
    VectorX x(diagonal_.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      x[i] = std::sin(1.0 + 0.7 * real(i));  // anything that has a part along every direction
    }
    for (int k = 0; k < iterations; ++k) {
      VectorX right = diagonal_.cwiseProduct(x);
      mask(solver_.free(), right);
      if (!solver_.solve(shifted, right, x, true).solved) {
        return false;
      }
      const double largest = largest_shift(x);
      if (!(largest > 0)) {
        return false;
      }
      x /= largest;
    }
    VectorX product;
    multiply(matrix_, x, product);
    const double curvature = x.dot(product) / x.dot(diagonal_.cwiseProduct(x));
    if (pushed_.size() > 0) {  // where it is hardly less than level it goes on the same way, farther each time
      x *= pushed_.dot(x) < 0 ? -1 : 1;
      push_ = std::min(2 * push_, largest_push * thickness_);
    }
    advance_configuration(system_, push_ * x, configuration_);
    pushed_ = x;
    // With twice its negative curvature a step moves as far again.
    viscosity_ = curvature < 0 ? -2 * curvature : viscosity_;
    return true;
  }

  /// To where the forces balance those of the viscosity, or at least lead on. @return false where the stiffness is not
  /// positive with so little of it, or where the forces at the end push back
  bool step() {
    VectorX driving = now_.unbalanced;
    mask(solver_.free(), driving);
    VectorX right = driving, moved, increment;
    BlockMatrix tangent = matrix_;
    Configuration next = configuration_;
    double left = infinity, work = 0;  // of the forces at the end, along the whole step
    for (std::size_t i = 0; i < most_iterations_of_step && left > loose * force_norm(system_, driving); ++i) {
      add_diagonal(viscosity_, diagonal_, tangent);
      const TangentSolver::Result solved = solver_.solve(tangent, right, increment);
      ++result_.iterations;
      result_.cg_iterations += solved.cg_iterations;
      const bool positive = solved.solved && (says_nothing_ || solved.positive_definite);
      result_.lost_stability = result_.lost_stability || !positive;
      if (!positive) {
        break;
      }
      limit(system_, increment);
      Configuration then = next;
      advance_configuration(system_, increment, then);
      expand_carried(system_.carried, system_.surfaces, system_.reference, next, increment);
      const Balance at = balance_(then, &tangent, predicted_deformations(system_, next, increment));
      VectorX change = change_of(configuration_, then);
      right = at.unbalanced - viscosity_ * diagonal_.cwiseProduct(change);
      mask(solver_.free(), right);
      const double norm = force_norm(system_, right);
      if (!at.valid || (i > 0 && !(norm < falls * left))) {
        break;
      }
      next = std::move(then);
      moved = std::move(change);
      left = norm;
      work = at.unbalanced.dot(moved);
    }
    if (moved.size() == 0 || work < -largest_push_back * driving.dot(moved)) {
      return false;
    }
    configuration_ = std::move(next);
    return true;
  }

  const ShellSystem& system_;
  const RunSettings& settings_;
  TangentSolver& solver_;
  const BalanceFunction& balance_;
  const double thickness_;
  double push_;     ///< mm, off a state that is not stable, the farthest node
  VectorX pushed_;  ///< where to, the last time
  BlockMatrix& matrix_;
  Configuration& configuration_;
  const VectorX diagonal_;
  const bool says_nothing_;  ///< the tangent of what slides is unsymmetric: its pivots tell of no stability
  Balance now_;
  double viscosity_ = first_viscosity;
  SettleResult result_;
};

}  // namespace

SettleResult settle(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, BlockMatrix& matrix, Configuration& configuration) {
  return Descent(system, settings, solver, balance, matrix, configuration).run();
}

}  // namespace tunica
