// The error that conjugate gradients tell, against the true one.

#include "benchmarks.hpp"
#include "tunica/mechanics/algebra/linear_solver.hpp"
#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using namespace benchmarks;

Model vessel(std::size_t around, std::size_t along, double thickness) {
  Model model;
  ShellBody body = flat_body(make_vessel(around, along), 1, 0.45, thickness);
  body.curved = true;
  body.rest = Rest::curved;
  model.shells.push_back(body);
  hold(
      model, [](const Vec3& p) { return p.z() < 1e-9 || p.z() > 60 - 1e-9; }, "xyz", "xyz");
  model.loads.push_back({0, PressureLoad{1e-3, true}, {}});
  return model;
}

/// A sphere that stands on a cap and is pressed down by its weight.
Model sphere(int levels, double thickness) {
  Model model;
  model.shells.push_back(flat_body(make_sphere(10, levels), 1, 0.3, thickness));
  hold(
      model, [](const Vec3& p) { return p.z() < -8; }, "xyz", "");
  model.loads.push_back({0, AreaLoad{Vec3(0, 2e-5, -1e-4)}, {}});
  return model;
}

struct Problem {
  BlockMatrix matrix;
  FreeMask free;
  VectorX right;
  VectorX exact;

  explicit Problem(const Model& model) {
    const ShellSystem system = make_system(model);
    matrix = system.pattern;
    linear_stiffness(system, matrix);
    symmetrise(matrix);
    for (const bool held : system.held) {
      free.push_back(!held);
    }
    Forces forces;
    evaluate(system, {reference_configuration(system), {1}}, forces, nullptr);
    right = forces.external;
    mask(free, right);
    DirectSolver solver(matrix, free);
    solver.factor(matrix);
    solver.solve(right, exact);
    VectorX correction;
    solver.solve(right - product(exact), correction);
    exact += correction;
  }

  [[nodiscard]] VectorX product(const VectorX& x) const {
    VectorX y;
    multiply(matrix, x, y);
    mask(free, y);
    return y;
  }
  [[nodiscard]] double energy_norm(const VectorX& x) const { return std::sqrt(x.dot(product(x))); }
};

std::vector<Model> models() { return {vessel(20, 20, 1), vessel(40, 25, 0.2), sphere(3, 1), sphere(3, 0.1)}; }

TEST(AlgebraicError, IsWithinAFactorOfTwoWhereTheToleranceIsReached) {
  for (const Model& model : models()) {
    const Problem problem(model);
    for (const double tolerance : {0.5, 0.05, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8}) {
      VectorX x;
      const CgResult cg = conjugate_gradients(problem.matrix, problem.free, problem.right, {tolerance, {}, false}, x);
      ASSERT_TRUE(cg.converged);
      ASSERT_TRUE(cg.error);
      const double truth = problem.energy_norm(x - problem.exact) / problem.energy_norm(problem.exact);
      EXPECT_FALSE(cg.error->is_lower_bound) << problem.free.size() << " " << tolerance;
      EXPECT_GT(cg.error->relative(), 0.5 * truth) << problem.free.size() << ' ' << tolerance;
      EXPECT_LT(cg.error->relative(), 2.0 * truth) << problem.free.size() << ' ' << tolerance;
    }
  }
}

TEST(AlgebraicError, IsALowerBoundWhereTheIterationsEnd) {
  for (const Model& model : models()) {
    const Problem problem(model);
    for (const std::size_t most : {1, 10, 30, 100}) {
      for (const bool fixed : {true, false}) {
        VectorX x;
        const CgResult cg = conjugate_gradients(problem.matrix, problem.free, problem.right, {1e-12, most, fixed}, x);
        const double truth = problem.energy_norm(x - problem.exact) / problem.energy_norm(problem.exact);
        EXPECT_EQ(cg.iterations, most);
        ASSERT_TRUE(cg.error);
        EXPECT_TRUE(cg.error->is_lower_bound);
        EXPECT_LE(cg.error->relative(), truth * (1 + 1e-6)) << problem.free.size() << ' ' << most;
        EXPECT_GT(cg.error->relative(), 0.02 * truth) << problem.free.size() << ' ' << most;
      }
    }
  }
}

TEST(AlgebraicError, DoesNotChangeTheSolution) {
  const Problem problem(vessel(20, 20, 1));
  // A run to the round-off of one iterate's residual ends with that iterate, whatever it does for its error.
  VectorX capped;
  const CgResult first = conjugate_gradients(problem.matrix, problem.free, problem.right, {1e-12, 60, true}, capped);
  VectorX stopped;
  const CgResult second =
      conjugate_gradients(problem.matrix, problem.free, problem.right, {first.residual, {}, false}, stopped);
  EXPECT_LE(second.iterations, first.iterations);
  if (second.iterations == first.iterations) {
    EXPECT_EQ(capped, stopped);
  }
  VectorX residual = problem.right - problem.product(capped);
  EXPECT_NEAR(residual.norm() / problem.right.norm(), first.residual, 1e-9);
}

TEST(AlgebraicError, OfTheDirectSolverIsTheOneOfItsSolution) {
  const Problem problem(vessel(20, 20, 1));
  DirectSolver solver(problem.matrix, problem.free);
  solver.factor(problem.matrix);
  VectorX rough;
  conjugate_gradients(problem.matrix, problem.free, problem.right, {1e-3, {}, false}, rough);
  const AlgebraicError error = error_by_factor(problem.matrix, problem.free, solver, problem.right, rough);
  const double truth = problem.energy_norm(rough - problem.exact);
  EXPECT_NEAR(error.error, truth, 1e-6 * truth);
  EXPECT_LT(error_by_factor(problem.matrix, problem.free, solver, problem.right, problem.exact).relative(), 1e-9);
}

TEST(AlgebraicError, IsToldByRuns) {
  const Model model = vessel(20, 20, 1);
  RunSettings settings = linear_run();
  Summary direct = solve(model, settings, [](const State&) {});
  ASSERT_TRUE(direct.algebraic_error);
  EXPECT_LT(*direct.algebraic_error, 1e-9);
  settings.solver = Solver::cg;
  settings.cg_iterations = 30;
  settings.cg_fixed_count = true;
  const Summary capped = solve(model, settings, [](const State&) {});
  ASSERT_TRUE(capped.algebraic_error);
  EXPECT_TRUE(capped.algebraic_error_is_bound);
  EXPECT_GT(*capped.algebraic_error, 0.01);
  settings.cg_fixed_count = false;
  settings.cg_iterations.reset();
  settings.cg_tolerance = 1e-4;
  const Summary tolerant = solve(model, settings, [](const State&) {});
  ASSERT_TRUE(tolerant.algebraic_error);
  EXPECT_FALSE(tolerant.algebraic_error_is_bound);
  EXPECT_LT(*tolerant.algebraic_error, *capped.algebraic_error);
}

}  // namespace
}  // namespace tunica
