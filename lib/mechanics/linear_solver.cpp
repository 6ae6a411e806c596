#include "mechanics/linear_solver.hpp"

#include "core/error.hpp"
#include "core/progress.hpp"
#include "core/threads.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Dense>

#include <cmath>

namespace tunica {

void mask(const FreeMask& free, VectorX& v) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) {
      v[static_cast<Eigen::Index>(i)] = 0;
    }
  }
}

CgResult conjugate_gradients(const BlockMatrix& matrix, const FreeMask& free, const VectorX& b,
                             const CgOptions& options, VectorX& x) {
  const std::size_t nodes = matrix.node_count();
  // Held rows and columns are left out of the diagonal blocks; a unit keeps them regular.
  std::vector<Matrix6, Eigen::aligned_allocator<Matrix6>> inverse(nodes);
  std::vector<char> positive(nodes, 1);
  parallel_for_blocks(nodes, 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Matrix6 block = matrix.block(matrix.find(static_cast<Index>(i), static_cast<Index>(i)));
      for (int c = 0; c < 6; ++c) {
        if (!free[6 * i + static_cast<std::size_t>(c)]) {
          block.row(c).setZero();
          block.col(c).setZero();
          block(c, c) = 1;
        }
      }
      const Eigen::LLT<Matrix6> factor(block);
      positive[i] = factor.info() == Eigen::Success ? 1 : 0;
      inverse[i] = positive[i] != 0 ? Matrix6(factor.solve(Matrix6::Identity())) : Matrix6::Identity();
    }
  });
  CgResult result;
  result.negative_curvature = std::find(positive.begin(), positive.end(), 0) != positive.end();

  VectorX r = b;
  mask(free, r);
  x.setZero(b.size());
  const double norm = std::sqrt(dot(r, r));
  if (norm == 0) {
    result.converged = true;
    return result;
  }
  const auto precondition = [&](const VectorX& v, VectorX& z) {
    z.resize(v.size());
    for (std::size_t i = 0; i < nodes; ++i) {
      z.segment<6>(6 * static_cast<Eigen::Index>(i)).noalias() =
          inverse[i] * v.segment<6>(6 * static_cast<Eigen::Index>(i));
    }
  };
  VectorX z, p, q;
  precondition(r, z);
  p = z;
  double rho = dot(r, z);
  const std::size_t most = options.most.value_or(20 * free.size());
  result.residual = 1;
  while (result.iterations < most) {
    if (result.iterations % 64 == 0) {
      check_interrupt();
    }
    multiply(matrix, p, q);
    mask(free, q);
    const double curvature = dot(p, q);
    if (!(curvature > 0)) {
      result.negative_curvature = result.negative_curvature || curvature < 0;
      if (result.iterations == 0) {
        x = p;  // a direction of descent is better than none
      }
      break;
    }
    const double step = rho / curvature;
    x += step * p;
    r -= step * q;
    ++result.iterations;
    result.residual = std::sqrt(dot(r, r)) / norm;
    if (result.residual <= (options.fixed_count ? 1e-15 : options.tolerance)) {
      break;
    }
    precondition(r, z);
    const double next = dot(r, z);
    p = z + next / rho * p;
    rho = next;
  }
  result.converged = !options.fixed_count && result.residual <= options.tolerance;
  return result;
}

double gmres(const BlockMatrix& matrix, const FreeMask& free, DirectSolver& solver, const VectorX& b, double tolerance,
             std::size_t most, VectorX& x) {
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
  Eigen::MatrixXd hessenberg =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(most) + 1, static_cast<Eigen::Index>(most));
  Eigen::VectorXd coefficients;
  for (std::size_t j = 0; j < most; ++j) {
    VectorX direction;
    solver.solve(basis[j], direction);
    multiply(matrix, direction, product);
    mask(free, product);
    directions.push_back(direction);
    const auto column = static_cast<Eigen::Index>(j);
    for (std::size_t i = 0; i <= j; ++i) {
      const double h = dot(basis[i], product);
      hessenberg(static_cast<Eigen::Index>(i), column) = h;
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
    x += coefficients[j] * directions[static_cast<std::size_t>(j)];
  }
  r = residual();
  return std::sqrt(dot(r, r)) / norm;
}

}  // namespace tunica
