#include "tunica/mechanics/runs/detail/settle.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t most_settling_iterations = 200;
constexpr double first_viscosity = 1e-3;  // of the stiffness against moving one node alone
constexpr double least_viscosity = 1e-9;  // less is none
constexpr double largest_viscosity = 1e6;
/// Of the work of the unbalanced forces along a step that they may do against it at its end.
constexpr double largest_push_back = 0.5;
constexpr double largest_settling_turn = 0.3;  // rad per iteration

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

/// Shortens an increment that turns or moves a node too far for one step.
void limit(const ShellSystem& system, VectorX& increment) {
  double turn = 0;
  double move = 0;
  for (Eigen::Index i = 0; i < increment.size(); i += 6) {
    move = std::max(move, increment.segment<3>(i).norm());
    turn = std::max(turn, increment.segment<3>(i + 3).norm());
  }
  increment *= std::min(
      {1.0, largest_settling_turn / std::max(turn, largest_settling_turn), system.length / std::max(move, 1e-300)});
}

}  // namespace

namespace {

/// One call of settle().
class Descent {
public:
  Descent(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver, const BalanceFunction& balance,
          BlockMatrix& matrix, Configuration& configuration)
      : system_(system),
        settings_(settings),
        solver_(solver),
        balance_(balance),
        matrix_(matrix),
        configuration_(configuration),
        diagonal_(viscous_diagonal(system)),
        now_(balance(configuration, &matrix, {})),
        norm_(now_.valid ? norm_of(now_) : 0) {}

  SettleResult run() {
    const double bound = longest_side(system_);
    for (; now_.valid && result_.iterations < most_settling_iterations; ++result_.iterations) {
      check_interrupt();
      result_.residual = now_.scale > 0 ? norm_ / now_.scale : 0;
      const bool at_rest = result_.residual <= settings_.converge || norm_ <= now_.floor;
      if (at_rest && positive_without_ && system_.contact && system_.contact->sharpen()) {
        now_ = balance_(configuration_, &matrix_, {});
        norm_ = norm_of(now_);
        continue;
      }
      if (at_rest && positive_without_) {
        result_.settled = true;
        return result_;
      }
      if (at_rest || viscosity_ < least_viscosity) {
        viscosity_ = 0;
      }
      if (!step()) {
        viscosity_ = std::max(4 * viscosity_, least_viscosity);
        if (viscosity_ > largest_viscosity) {
          return result_;
        }
      } else if (largest_displacement(configuration_) > bound) {
        result_.ran_away = true;
        return result_;
      }
    }
    return result_;
  }

private:
  [[nodiscard]] double norm_of(const Balance& balance) const {
    VectorX free = balance.unbalanced;
    mask(solver_.free(), free);
    return force_norm(system_, free);
  }

  /// An implicit step. @return false where it would not lead downhill, or too far: it takes more viscosity.
  bool step() {
    VectorX right = now_.unbalanced;
    mask(solver_.free(), right);
    BlockMatrix shifted = matrix_;
    add_diagonal(viscosity_, diagonal_, shifted);
    VectorX increment;
    const TangentSolver::Result solved = solver_.solve(shifted, right, increment);
    result_.cg_iterations += solved.cg_iterations;
    if (!solved.solved || !solved.positive_definite) {
      positive_without_ = false;
      result_.lost_stability = true;
      return false;
    }
    positive_without_ = viscosity_ == 0;
    limit(system_, increment);
    Configuration next = configuration_;
    advance_configuration(system_, increment, next);
    BlockMatrix next_matrix = std::move(shifted);
    const Balance then = balance_(next, &next_matrix, {});
    // Beyond the bottom of a valley the forces push back.
    if (!then.valid || then.unbalanced.dot(increment) < -largest_push_back * right.dot(increment)) {
      return false;
    }
    configuration_ = std::move(next);
    matrix_ = std::move(next_matrix);
    const double then_norm = norm_of(then);
    // As little as leads on: a shell that leaves its path moves slowly at first, whatever the residual.
    viscosity_ *= std::clamp(then_norm / norm_, 0.1, 0.5);
    now_ = then;
    norm_ = then_norm;
    return true;
  }

  const ShellSystem& system_;
  const RunSettings& settings_;
  TangentSolver& solver_;
  const BalanceFunction& balance_;
  BlockMatrix& matrix_;
  Configuration& configuration_;
  const VectorX diagonal_;
  Balance now_;
  double norm_;
  double viscosity_ = first_viscosity;
  bool positive_without_ = false;
  SettleResult result_;
};

}  // namespace

SettleResult settle(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, BlockMatrix& matrix, Configuration& configuration) {
  return Descent(system, settings, solver, balance, matrix, configuration).run();
}

VectorX weakest_direction(const ShellSystem& system, TangentSolver& solver, const BalanceFunction& balance,
                          BlockMatrix& matrix, const Configuration& configuration) {
  constexpr int iterations = 6;
  (void)balance(configuration, &matrix, {});
  const VectorX diagonal = viscous_diagonal(system);
  VectorX x(diagonal.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    x[i] = std::sin(1.0 + 0.7 * real(i));  // anything that has a part along every direction
  }
  VectorX product;
  for (int k = 0; k < iterations; ++k) {
    VectorX right = diagonal.cwiseProduct(x);
    mask(solver.free(), right);
    BlockMatrix copy = matrix;
    if (!solver.solve(copy, right, x).solved) {
      return VectorX::Zero(diagonal.size());
    }
    double largest = 0;
    for (Eigen::Index i = 0; i < x.size(); i += 6) {
      largest = std::max(largest, x.segment<3>(i).norm());
    }
    if (!(largest > 0)) {
      return VectorX::Zero(diagonal.size());
    }
    x /= largest;
  }
  return x;
}

}  // namespace tunica
