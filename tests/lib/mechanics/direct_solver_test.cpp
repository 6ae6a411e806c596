// The factorisation against dense linear algebra: solutions, inertia, held freedoms, and the same bits on more threads.

#include "tunica/mechanics/algebra/direct_solver.hpp"
#include "benchmarks.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

namespace tunica {
namespace {

using namespace benchmarks;

struct Factorable {
  BlockMatrix matrix;
  FreeMask free;
  VectorX right;
};

/// The stiffness of a sphere's shell minus `shift` times its own diagonal, with freedoms held here and there.
Factorable sphere_problem(int levels, double shift) {
  Model model;
  model.shells.push_back(flat_body(make_sphere(10, levels), 1, 0.3, 0.5));
  const ShellSystem system = make_system(model);
  Factorable problem{system.pattern, FreeMask(6 * system.node_count(), true), {}};
  linear_stiffness(system, problem.matrix);
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    auto block = problem.matrix.block(problem.matrix.find(static_cast<Index>(i), static_cast<Index>(i)));
    block.diagonal() *= 1 - shift;
    for (std::size_t c = 0; c < 6; ++c) {
      problem.free[6 * i + c] = !(i % 17 == 0 || (i % 5 == 1 && c == 2) || (i % 7 == 3 && c >= 3));
    }
  }
  problem.right.resize(static_cast<Eigen::Index>(problem.free.size()));
  for (Eigen::Index i = 0; i < problem.right.size(); ++i) {
    problem.right[i] = std::sin(1.0 + static_cast<double>(i));
  }
  return problem;
}

std::vector<Eigen::Index> free_freedoms(const FreeMask& free) {
  std::vector<Eigen::Index> result;
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (free[i]) {
      result.push_back(static_cast<Eigen::Index>(i));
    }
  }
  return result;
}

Eigen::MatrixXd dense(const Factorable& problem) {
  const auto size = static_cast<Eigen::Index>(problem.free.size());
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < problem.matrix.node_count(); ++i) {
    for (std::size_t k = problem.matrix.row_start[i]; k < problem.matrix.row_start[i + 1]; ++k) {
      full.block<6, 6>(6 * static_cast<Eigen::Index>(i), 6 * static_cast<Eigen::Index>(problem.matrix.column[k])) =
          problem.matrix.block(k);
    }
  }
  const std::vector<Eigen::Index> f = free_freedoms(problem.free);
  return 0.5 * (full + full.transpose())(f, f);
}

TEST(DirectSolver, SolvesAndCountsWhatDenseAlgebraDoes) {
  for (const double shift : {0.0, 0.02, 0.3}) {
    const Factorable problem = sphere_problem(2, shift);
    DirectSolver solver(problem.matrix, problem.free);
    const DirectSolver::Factored factored = solver.factor(problem.matrix);
    const Eigen::MatrixXd matrix = dense(problem);
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix).eigenvalues();
    ASSERT_TRUE(factored.regular);
    EXPECT_EQ(factored.negative_pivots, static_cast<std::size_t>((values.array() < 0).count())) << shift;
    EXPECT_EQ(factored.negative_pivots > 0, shift > 0);
    VectorX x;
    solver.solve(problem.right, x);
    const std::vector<Eigen::Index> f = free_freedoms(problem.free);
    const Eigen::VectorXd wanted = matrix.partialPivLu().solve(Eigen::VectorXd(problem.right(f)));
    EXPECT_LT((x(f) - wanted).norm(), 1e-9 * wanted.norm()) << shift;
    EXPECT_NEAR(x.norm(), Eigen::VectorXd(x(f)).norm(), 1e-14 * x.norm()) << "held freedoms stay zero";
  }
}

TEST(DirectSolver, FactorsAgainAndIsTheSameToTheBitOnMoreThreads) {
  const std::size_t before = thread_count();
  std::vector<VectorX> solutions;
  for (const std::size_t threads : {1U, 4U, 4U}) {
    set_thread_count(threads);
    const Factorable problem = sphere_problem(4, 0.05);
    DirectSolver solver(problem.matrix, problem.free);
    for (const double factor : {2.0, 1.0}) {  // what an earlier factor left must not show
      BlockMatrix scaled = problem.matrix;
      for (double& value : scaled.values) {
        value *= factor;
      }
      EXPECT_TRUE(solver.factor(scaled).regular);
    }
    solutions.emplace_back();
    solver.solve(problem.right, solutions.back());
  }
  set_thread_count(before);
  EXPECT_EQ(solutions[0], solutions[1]);
  EXPECT_EQ(solutions[0], solutions[2]);
}

TEST(DirectSolver, SaysThatAPivotVanishes) {
  Factorable problem = sphere_problem(1, 0);
  auto block = problem.matrix.block(problem.matrix.find(8, 8));
  for (std::size_t k = problem.matrix.row_start[8]; k < problem.matrix.row_start[9]; ++k) {
    problem.matrix.block(k).row(1).setZero();
    problem.matrix.block(problem.matrix.transposed[k]).col(1).setZero();
  }
  ASSERT_TRUE(problem.free[6 * 8 + 1]);
  EXPECT_EQ(block(1, 1), 0);
  DirectSolver solver(problem.matrix, problem.free);
  EXPECT_FALSE(solver.factor(problem.matrix).regular);
  const FreeMask nothing(problem.free.size(), false);
  DirectSolver idle(problem.matrix, nothing);
  EXPECT_TRUE(idle.factor(problem.matrix).regular);
  VectorX x;
  idle.solve(problem.right, x);
  EXPECT_EQ(x, VectorX::Zero(problem.right.size()));
}

}  // namespace
}  // namespace tunica
