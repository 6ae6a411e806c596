#include "mechanics/newton.hpp"

#include "core/progress.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double largest_turn = 0.5;        // rad per iteration
constexpr std::size_t free_iterations = 6;  // full steps before the line search sets in
constexpr double gmres_tolerance = 1e-4;    // relative residual of the unsymmetric system
constexpr std::size_t gmres_iterations = 30;

double largest_rotation(const VectorX& increment) {
  double largest = 0;
  for (Eigen::Index i = 3; i < increment.size(); i += 6) {
    largest = std::max(largest, increment.segment<3>(i).norm());
  }
  return largest;
}

bool uses_cg(const RunSettings& settings) { return settings.solver == Solver::cg; }

}  // namespace

FreeMask free_freedoms(const ShellSystem& system) {
  FreeMask free = system.held;
  free.flip();
  return free;
}

TangentSolver::TangentSolver(const ShellSystem& system, const RunSettings& settings)
    : settings_(settings), free_(free_freedoms(system)) {
  if (!uses_cg(settings)) {
    direct_.emplace(system.pattern, free_);
  }
}

std::size_t TangentSolver::freedom_count() const {
  return static_cast<std::size_t>(std::count(free_.begin(), free_.end(), true));
}

TangentSolver::Result TangentSolver::solve(BlockMatrix& matrix, const VectorX& b, VectorX& x, bool same_matrix) {
  Result result;
  if (freedom_count() == 0) {
    x.setZero(b.size());
    return {true, true, true, 0, 0, AlgebraicError{}};
  }
  if (!direct_) {
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
    factored_ = direct_->factor(matrix);
  }
  if (!factored_.regular) {
    return result;
  }
  result.positive_definite = factored_.negative_pivots == 0;
  direct_->solve(b, x);
  if (!x.allFinite()) {
    return result;
  }
  result.residual = gmres(matrix, free_, *direct_, b, gmres_tolerance, gmres_iterations, x);
  result.solved = x.allFinite();
  result.converged = result.solved;
  if (tell_direct_error_ && result.solved && result.positive_definite) {
    result.error = error_by_factor(matrix, free_, *direct_, b, x);
  }
  return result;
}

double increment_size(const ShellSystem& system, const VectorX& increment) {
  double sum = 0;
  for (Eigen::Index i = 0; i < increment.size(); i += 6) {
    sum += increment.segment<3>(i).squaredNorm() +
           system.length * system.length * increment.segment<3>(i + 3).squaredNorm();
  }
  return std::sqrt(sum / (static_cast<double>(increment.size()) / 6));
}

NewtonResult newton(const ShellSystem& system, const RunSettings& settings, TangentSolver& solver,
                    const BalanceFunction& balance, const VectorX& held_increment, BlockMatrix& matrix,
                    Configuration& configuration, bool likely_at_rest) {
  NewtonResult result;
  bool moving = held_increment.squaredNorm() > 0;
  Balance now = balance(configuration, likely_at_rest ? nullptr : &matrix);
  bool tangent_is_current = !likely_at_rest;
  double largest_solution = 0;
  double previous_residual = 0;
  VectorX increment;
  VectorX whole = VectorX::Zero(held_increment.size());
  const auto residual_of = [&](const Balance& b) {
    VectorX free = b.unbalanced;
    mask(solver.free(), free);
    const double norm = force_norm(system, free);
    return b.scale > 0 ? norm / b.scale : (norm > 0 ? 1.0 : 0.0);
  };
  const auto reached = [&](const Balance& b, double residual) {
    return residual <= settings.converge || residual * b.scale <= b.floor;
  };
  if (!now.valid) {
    return result;
  }
  result.valid = true;
  result.stable = true;
  result.linear_converged = true;
  result.residual = residual_of(now);
  if (!moving && (now.scale == 0 || result.residual <= settings.converge)) {
    result.converged = true;
    return result;
  }
  for (result.iterations = 0; result.iterations < settings.newton_max;) {
    check_interrupt();
    if (!tangent_is_current) {
      now = balance(configuration, &matrix);
    }
    VectorX right = now.unbalanced;
    if (moving) {
      VectorX product;
      multiply(matrix, held_increment, product);
      right -= product;
    }
    mask(solver.free(), right);
    const TangentSolver::Result solved = solver.solve(matrix, right, increment);
    result.cg_iterations += solved.cg_iterations;
    result.stable = solved.positive_definite;
    result.linear_converged = solved.converged;
    result.algebraic_error = solved.error;
    if (solved.error) {
      largest_solution = std::max(largest_solution, solved.error->solution);
      result.algebraic_error->solution = largest_solution;
    }
    ++result.iterations;
    if (!solved.solved) {
      result.valid = false;
      return result;
    }
    const double work = right.dot(increment);
    if (moving) {
      increment += held_increment;
    } else if (const double turn = largest_rotation(increment); turn > largest_turn) {
      increment *= largest_turn / turn;
    }
    if (result.iterations == 1) {
      result.predicted = increment_size(system, increment);
    }

    // Where another iteration will follow, judged by quadratic convergence, its tangent is made with the forces.
    const double expected =
        result.iterations > 1 ? std::pow(result.residual, 3) / (previous_residual * previous_residual) : 1;
    const bool more = result.iterations < settings.newton_max && expected > settings.converge;
    previous_residual = result.residual;
    const Configuration before = configuration;
    double length = 1;
    Balance next;
    for (int trial = 0;; ++trial) {
      configuration = before;
      advance_configuration(configuration, length * increment);
      tangent_is_current = more && trial == 0;
      next = balance(configuration, tangent_is_current ? &matrix : nullptr);
      if (moving || trial == 6) {
        break;
      }
      if (!next.valid) {
        length /= 2;
        continue;
      }
      if (result.iterations <= free_iterations) {
        break;
      }
      VectorX free = next.unbalanced;
      mask(solver.free(), free);
      const double left = free.dot(increment);
      if (std::abs(left) <= 0.8 * std::abs(work) || work <= 0) {
        break;
      }
      const double secant = length * work / (work - left);
      length = std::clamp(secant, 0.2 * length, 0.7 * length);
    }
    whole += length * increment;
    result.reached = increment_size(system, whole);
    result.valid = next.valid;
    if (!next.valid) {
      return result;
    }
    moving = false;
    now = next;
    result.residual = residual_of(next);
    if (!std::isfinite(result.residual)) {
      result.valid = false;
      return result;
    }
    if (reached(next, result.residual)) {
      result.converged = true;
      return result;
    }
  }
  return result;
}

}  // namespace tunica
