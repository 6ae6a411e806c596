#include "tunica/mechanics/algebra/linear_solver.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/require.hpp"
#include "tunica/core/threads.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Dense>

#include <cmath>

namespace tunica {

namespace {

/// Inverses of the diagonal blocks. Held rows and columns are left out; a unit keeps the blocks regular.
struct BlockJacobi {
  std::vector<Matrix6, Eigen::aligned_allocator<Matrix6>> inverse;
  bool positive = true;  ///< every block is positive definite; the others are replaced by units

  BlockJacobi(const BlockMatrix& matrix, const FreeMask& free) : inverse(matrix.node_count()) {
    std::vector<char> good(matrix.node_count(), 1);
    std::vector<Matrix6, Eigen::aligned_allocator<Matrix6>> own(matrix.node_count() * (free.own_axes.empty() ? 0 : 1),
                                                                Matrix6::Identity());
    for (const NodeAxes& of : free.own_axes) {
      own[of.node].topLeftCorner<3, 3>() = own[of.node].bottomRightCorner<3, 3>() = of.axes;
    }
    parallel_for_blocks(matrix.node_count(), 256, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Matrix6 block = matrix.block(matrix.find(narrow<Index>(i), narrow<Index>(i)));
        if (!own.empty()) {
          block = (own[i] * block * own[i].transpose()).eval();
        }
        for (int c = 0; c < 6; ++c) {
          if (!free[freedom(i, narrow<std::size_t>(c))]) {
            block.row(c).setZero();
            block.col(c).setZero();
            block(c, c) = 1;
          }
        }
        const Eigen::LLT<Matrix6> factor(block);
        good[i] = factor.info() == Eigen::Success ? 1 : 0;
        inverse[i] = good[i] != 0 ? Matrix6(factor.solve(Matrix6::Identity())) : Matrix6::Identity();
        if (!own.empty()) {
          inverse[i] = (own[i].transpose() * inverse[i] * own[i]).eval();
        }
      }
    });
    positive = std::find(good.begin(), good.end(), 0) == good.end();
  }

  void apply(const VectorX& r, VectorX& z) const {
    z.resize(r.size());
    parallel_for_blocks(inverse.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        multiply_block(inverse[i].data(), r.data() + 6 * i, z.data() + 6 * i);
      }
    });
  }
};

void require_solvable(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b, const CgOptions& options) {
  require_freedoms(free.size(), matrix.node_count());
  require_freedoms(narrow<std::size_t>(b.size()), matrix.node_count());
  if (!options.fixed_count) {
    require_not_negative(options.tolerance, "the tolerance of conjugate gradients");
  }
}

}  // namespace

CgResult conjugate_gradients(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b,
                             const CgOptions& options, VectorX& x) {
  require_solvable(matrix, free, b, options);
  const BlockJacobi preconditioner(matrix, free);
  CgResult result;
  result.negative_curvature = !preconditioner.positive;

  VectorX r = b;
  mask(free, r);
  x.setZero(b.size());
  const double norm = std::sqrt(dot(r, r));
  if (norm == 0) {
    result.converged = true;
    result.error.emplace();
    return result;
  }
  VectorX z, p, q;
  preconditioner.apply(r, z);
  p = z;
  double rho = dot(r, z);
  const std::size_t most = options.most.value_or(20 * free.size());
  const double wanted = options.fixed_count ? 1e-15 : options.tolerance;
  result.residual = 1;
  std::vector<double> terms;
  bool done = false;       // x is final, what follows is for its error
  std::size_t enough = 0;  // terms after which that ends
  while (true) {
    if (!done && (result.residual <= wanted || result.iterations >= most)) {
      done = true;
      enough =
          result.iterations + (result.residual <= wanted ? 4 * result.iterations + 100 : result.iterations / 10 + 1);
    }
    if (done &&
        (terms.size() >= enough || (result.residual <= wanted && estimate_is_settled(terms, result.iterations)))) {
      break;
    }
    if (terms.size() % 64 == 0) {
      check_interrupt();
    }
    multiply(matrix, p, q);
    mask(free, q);
    const double curvature = dot(p, q);
    if (!(curvature > 0)) {
      if (!done) {
        result.negative_curvature = result.negative_curvature || curvature < 0;
        if (result.iterations == 0) {
          x = p;  // a direction of descent is better than none
        }
      }
      break;
    }
    const double step = rho / curvature;
    terms.push_back(step * rho);
    r -= step * q;
    if (!done) {
      x += step * p;
      ++result.iterations;
      result.residual = std::sqrt(dot(r, r)) / norm;
    }
    preconditioner.apply(r, z);
    const double next = dot(r, z);
    p = z + next / rho * p;
    rho = next;
  }
  result.converged = !options.fixed_count && result.residual <= options.tolerance;
  if (!result.negative_curvature && !terms.empty() && std::isfinite(terms.back())) {
    result.error = error_of_iterate(terms, std::min(result.iterations, terms.size()));
    result.error->is_lower_bound = result.residual > wanted || !done || !estimate_is_settled(terms, result.iterations);
  }
  return result;
}

AlgebraicError error_by_factor(const BlockMatrix& matrix, const FreeMask& free, const DirectSolver& solver,
                               const VectorX& b, const VectorX& x) {
  require_freedoms(narrow<std::size_t>(b.size()), matrix.node_count());
  VectorX product;
  multiply(matrix, x, product);
  VectorX r = b - product;
  mask(free, r);
  VectorX e;
  solver.solve(r, e);
  return {std::sqrt(std::abs(dot(r, e))), std::sqrt(std::abs(dot(b, x))), false};
}

double gmres(const BlockMatrix& matrix, const FreeMask& free, const DirectSolver& solver, const VectorX& b,
             VectorX& x) {
  constexpr double tolerance = 1e-4;
  constexpr std::size_t most = 30;
  require_freedoms(narrow<std::size_t>(b.size()), matrix.node_count());
  const double norm = std::sqrt(dot(b, b));
  VectorX product;
  const auto residual = [&] {
    multiply(matrix, x, product);
    mask(free, product);
    return VectorX(b - product);
  };
  VectorX r = residual();
  double beta = std::sqrt(dot(r, r));
  if (norm == 0 || beta <= tolerance * norm) {
    return norm == 0 ? 0 : beta / norm;
  }
  // Right preconditioning: the residual that is made small is the true one.
  std::vector<VectorX> basis{r / beta};
  std::vector<VectorX> directions;
  Eigen::MatrixXd hessenberg = Eigen::MatrixXd::Zero(most + 1, most);
  Eigen::VectorXd coefficients;
  for (std::size_t j = 0; j < most; ++j) {
    VectorX direction;
    solver.solve(basis[j], direction);
    multiply(matrix, direction, product);
    mask(free, product);
    directions.push_back(direction);
    const Eigen::Index column = j;
    for (std::size_t i = 0; i <= j; ++i) {
      const double h = dot(basis[i], product);
      hessenberg(i, column) = h;
      product -= h * basis[i];
    }
    const double length = std::sqrt(dot(product, product));
    hessenberg(column + 1, column) = length;
    const auto reduced = hessenberg.topLeftCorner(column + 2, column + 1);
    const Eigen::VectorXd right = beta * Eigen::VectorXd::Unit(column + 2, 0);
    coefficients = reduced.colPivHouseholderQr().solve(right);
    if ((reduced * coefficients - right).norm() <= tolerance * norm || length <= 1e-14 * beta) {
      break;
    }
    basis.push_back(product / length);
  }
  for (Eigen::Index j = 0; j < coefficients.size(); ++j) {
    x += coefficients[j] * directions[j];
  }
  r = residual();
  return std::sqrt(dot(r, r)) / norm;
}

}  // namespace tunica
