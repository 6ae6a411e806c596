#include "mechanics/settle.hpp"

#include "core/progress.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t most_iterations = 200;
constexpr double first_viscosity = 1e-3;  // of the stiffness against moving one node alone
constexpr double largest_viscosity = 1e6;
constexpr double largest_turn = 0.3;  // rad per iteration

Eigen::Index at(std::size_t node) { return 6 * static_cast<Eigen::Index>(node); }

/// The diagonal of the linear stiffness, one value per node for displacements and one for spins.
VectorX viscous_diagonal(const ShellSystem& system) {
  BlockMatrix stiffness = system.pattern;
  linear_stiffness(system, stiffness);
  VectorX diagonal(at(system.node_count()));
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    const auto block = stiffness.block(stiffness.find(static_cast<Index>(i), static_cast<Index>(i)));
    diagonal.segment<3>(at(i)).setConstant(block.diagonal().head<3>().mean());
    diagonal.segment<3>(at(i) + 3).setConstant(block.diagonal().tail<3>().mean());
  }
  return diagonal;
}

void add_diagonal(double factor, const VectorX& diagonal, BlockMatrix& matrix) {
  for (std::size_t i = 0; i < matrix.node_count(); ++i) {
    auto block = matrix.block(matrix.find(static_cast<Index>(i), static_cast<Index>(i)));
    block.diagonal() += factor * diagonal.segment<6>(at(i));
  }
}

/// The longest side of the box around the model.
double size_of(const ShellSystem& system) {
  Vec3 low = system.reference.front();
  Vec3 high = low;
  for (const Vec3& x : system.reference) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  return (high - low).maxCoeff();
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
  increment *= std::min({1.0, largest_turn / std::max(turn, largest_turn), system.length / std::max(move, 1e-300)});
}

}  // namespace

SettleResult settle(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, BlockMatrix& matrix, Configuration& configuration) {
  SettleResult result;
  const VectorX diagonal = viscous_diagonal(system);
  const double bound = size_of(system);
  double viscosity = first_viscosity;
  bool positive_without = false;
  Balance now = balance(configuration, &matrix);
  const auto norm_of = [&](const Balance& b) {
    VectorX free = b.unbalanced;
    mask(solver.free(), free);
    return force_norm(system, free);
  };
  double norm = now.valid ? norm_of(now) : 0;
  for (; now.valid && result.iterations < most_iterations; ++result.iterations) {
    check_interrupt();
    result.residual = now.scale > 0 ? norm / now.scale : 0;
    const bool at_rest = result.residual <= settings.converge || norm <= now.floor;
    if (at_rest && positive_without) {
      result.settled = true;
      return result;
    }
    if (at_rest || viscosity < 1e-9) {
      viscosity = 0;
    }
    VectorX right = now.unbalanced;
    mask(solver.free(), right);
    BlockMatrix shifted = matrix;
    add_diagonal(viscosity, diagonal, shifted);
    VectorX increment;
    const TangentSolver::Result solved = solver.solve(shifted, right, increment);
    result.cg_iterations += solved.cg_iterations;
    if (!solved.solved || !solved.positive_definite) {
      positive_without = false;
      result.lost_stability = true;
      viscosity = std::max(4 * viscosity, 1e-9);
      if (viscosity > largest_viscosity) {
        return result;
      }
      continue;
    }
    positive_without = viscosity == 0;
    limit(system, increment);
    Configuration next = configuration;
    advance_configuration(next, increment);
    BlockMatrix next_matrix = std::move(shifted);
    const Balance then = balance(next, &next_matrix);
    if (!then.valid) {
      viscosity = std::max(10 * viscosity, first_viscosity);
      if (viscosity > largest_viscosity) {
        return result;
      }
      continue;
    }
    configuration = std::move(next);
    matrix = std::move(next_matrix);
    const double then_norm = norm_of(then);
    viscosity *= std::clamp(then_norm / norm, 0.1, 2.0);
    now = then;
    norm = then_norm;
    if (largest_displacement(configuration) > bound) {
      result.ran_away = true;
      return result;
    }
  }
  return result;
}

VectorX weakest_direction(const ShellSystem& system, TangentSolver& solver, const BalanceFunction& balance,
                          BlockMatrix& matrix, const Configuration& configuration) {
  constexpr int iterations = 6;
  (void)balance(configuration, &matrix);
  const VectorX diagonal = viscous_diagonal(system);
  VectorX x(diagonal.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    x[i] = std::sin(1.0 + 0.7 * static_cast<double>(i));  // anything that has a part along every direction
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
