// Least squares on one node and on all; edits keep topology, curves and shapes.
#include "tunica/fit/detail/edits.hpp"

#include "shell/families.hpp"
#include "surface/shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/fit/detail/least_squares.hpp"
#include "tunica/fit/detail/start.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>

namespace tunica {
namespace {

/// A sphere's shells, attached and measured.
struct Ball {
  Target target{testing::sphere(5)};
  FitSamples samples{target, 320, true};
  FitMesh mesh;
  explicit Ball(int times, Patch patch = Patch::watertight) : mesh(shells_on(target, testing::sphere(times), patch)) {
    refresh();
  }
  double refresh() {
    samples.attach(mesh);
    return samples.measure(mesh);
  }
};

std::vector<Index> alive_nodes(const FitMesh& mesh) {
  std::vector<Index> out;
  for (Index v = 0; v < mesh.around.size(); ++v) {
    if (!mesh.around[v].empty()) {
      out.push_back(v);
    }
  }
  return out;
}

TEST(LeastSquares, AStepOfAllNodesBringsDisturbedShellsBack) {
  for (const Patch patch : {Patch::watertight, Patch::comas}) {
    Ball ball(1, patch);
    const double exact = ball.refresh();
    for (std::size_t v = 0; v < ball.mesh.positions.size(); ++v) {
      ball.mesh.positions[v] *= v % 2 == 0 ? 1.05 : 0.96;
    }
    const double before = ball.refresh();
    double left = 1;
    for (int i = 0; i < 4; ++i) {
      left *= least_squares_step(ball.mesh, ball.samples, {});
      ball.refresh();
    }
    EXPECT_LT(left, 0.05);
    EXPECT_LT(ball.refresh(), before / 5);
    EXPECT_LT(ball.refresh(), 2 * exact + 0.1 * before);
  }
}

TEST(LeastSquares, OnlyWhatIsFreeMoves) {
  Ball ball(1);
  for (Vec3& p : ball.mesh.positions) {
    p *= 1.03;
  }
  ball.refresh();
  ball.mesh.free.assign(ball.mesh.free.size(), 0);
  ball.mesh.free[7] = 1;
  const auto before = ball.mesh.positions;
  least_squares_step(ball.mesh, ball.samples, {});
  for (std::size_t v = 0; v < before.size(); ++v) {
    EXPECT_EQ(before[v] != ball.mesh.positions[v], v == 7) << v;
  }
}

TEST(LeastSquares, WhereTheLargestCountTheLargestErrorGetsSmaller) {
  Ball mean(1), largest(1);
  for (int i = 0; i < 6; ++i) {
    SquaresOptions options;
    least_squares_step(mean.mesh, mean.samples, options);
    options.largest = true;
    least_squares_step(largest.mesh, largest.samples, options);
    mean.refresh();
    largest.refresh();
  }
  EXPECT_LE(largest.refresh(), mean.refresh());
}

TEST(LeastSquares, NormalsAloneLeaveThePositions) {
  Ball ball(1);
  for (Vec3& n : ball.mesh.normals) {
    n = (n + Vec3(0.2, 0, 0)).normalized();
  }
  const auto before = ball.mesh.positions;
  const double error = ball.refresh();
  SquaresOptions options;
  options.positions = false;
  least_squares_step(ball.mesh, ball.samples, options);
  EXPECT_EQ(ball.mesh.positions, before);
  EXPECT_LT(ball.refresh(), error / 2);
}

TEST(Edits, CollapsesStopAtTheLimitAndAtTheSmallestMesh) {
  Ball ball(2);
  FitLimits limits;
  limits.error = 0.01;
  collapse_edges(ball.mesh, ball.samples, limits, 4, {});
  EXPECT_LT(ball.mesh.alive, 120u);
  for (const FitPatch& p : ball.mesh.patches) {
    EXPECT_LE(p.error, limits.error);
  }
  EXPECT_LE(ball.refresh(), 1.5 * limits.error);
  limits.error = std::numeric_limits<double>::infinity();
  limits.shape = {1e-3, -1, 1e9, std::numeric_limits<double>::infinity()};
  collapse_edges(ball.mesh, ball.samples, limits, 0, {});
  EXPECT_GE(ball.mesh.alive, 4u);
  EXPECT_TRUE(examine(flat_facets(ball.mesh.shell())).closed);
}

TEST(Edits, EveryKindKeepsAClosedOrientedManifold) {
  Ball ball(1);
  FitLimits limits;
  limits.error = 1;
  limits.shape.min_angle = 1;
  for (const Index v : alive_nodes(ball.mesh)) {
    const auto ring = ball.mesh.ring(v);
    if (ring.empty()) {
      continue;
    }
    std::vector<std::optional<Edit>> edits{collapse(ball.mesh, ball.samples, v, ring[0]), flip(ball.mesh, v, ring[1]),
                                           split(ball.mesh, v, ring[2]), move(ball.mesh, v, ball.mesh.positions[v])};
    const std::size_t kind = v % 4;
    if (!edits[kind]) {
      continue;
    }
    Trial trial = try_edit(ball.mesh, ball.samples, limits,
                           v % 8 < 4 ? *std::move(edits[kind]) : widened(ball.mesh, *std::move(edits[kind])));
    if (std::isfinite(trial.error)) {
      apply(ball.mesh, std::move(trial));
    }
    const MeshFacts facts = examine(flat_facets(ball.mesh.shell()));
    ASSERT_TRUE(facts.closed && facts.manifold && facts.oriented) << v;
    ASSERT_EQ(facts.euler, 2) << v;
  }
  // What the edits left of each patch is what measuring finds.
  for (Index t = 0; t < ball.mesh.patches.size(); ++t) {
    if (ball.mesh.patches[t].is_alive()) {
      const FitPatch before = ball.mesh.patches[t];
      ball.mesh.refresh(t);
      EXPECT_EQ(before.across, ball.mesh.patches[t].across);
      EXPECT_EQ(before.boundary, ball.mesh.patches[t].boundary);
    }
  }
}

TEST(Edits, BoundariesAreNeitherLeftNorCrossed) {
  const TriangleMesh mesh = testing::cylinder(32, 12, 10, 30);
  const Target target(mesh);
  FitMesh shells(shells_on(target, testing::cylinder(8, 4, 10, 30), Patch::watertight));
  const FitSamples samples(target, 64, true);
  samples.attach(shells);
  samples.measure(shells);
  std::size_t along = 0, across = 0;
  for (const auto& [u, v] : shells.edges()) {
    const auto edit = collapse(shells, samples, u, v);
    const bool at_boundary = shells.rank(u) > 0 || shells.rank(v) > 0;
    if (edit && at_boundary) {
      EXPECT_GT(shells.rank(edit->node), 0);
      (shells.is_feature(u, v) ? along : across) += 1;
    }
    if (shells.rank(u) > 0 && shells.rank(v) > 0 && !shells.is_feature(u, v)) {
      EXPECT_FALSE(edit.has_value());
    }
    EXPECT_FALSE(shells.is_feature(u, v) && flip(shells, u, v).has_value());
  }
  EXPECT_GT(along, 0u);
  EXPECT_GT(across, 0u);
}

TEST(Edits, ThinTrianglesAreMended) {
  Ball ball(2);
  // A node beside its neighbour: thin triangles on all sides.
  const auto ring = ball.mesh.ring(20);
  ball.mesh.positions[20] = (0.9 * ball.mesh.positions[ring[0]] + 0.1 * ball.mesh.positions[20]).normalized();
  ball.mesh.normals[20] = ball.mesh.positions[20];
  ball.refresh();
  FitLimits limits;
  limits.error = 0.02;
  const auto missing = [&] {
    double sum = 0;
    for (const FitPatch& p : ball.mesh.patches) {
      sum += p.is_alive() ? shape_shortfall(ball.mesh, p, limits.shape) : 0;
    }
    return sum;
  };
  ASSERT_GT(missing(), 0.1);
  mend_shapes(ball.mesh, ball.samples, limits, 1000);
  EXPECT_EQ(missing(), 0);
}

TEST(Start, CreasesAreCurvesOfTheTargetAndCurvatureIsNone) {
  // A coarse ball turns by more than 40 degrees from facet to facet, and has no crease.
  const Target ball(testing::sphere(5));
  EXPECT_TRUE(shells_on(ball, testing::sphere(0), Patch::watertight).corner_normals.empty());
  const TriangleMesh cube{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}},
                          {{0, 2, 1},
                           {0, 3, 2},
                           {4, 5, 6},
                           {4, 6, 7},
                           {0, 1, 5},
                           {0, 5, 4},
                           {2, 3, 7},
                           {2, 7, 6},
                           {1, 2, 6},
                           {1, 6, 5},
                           {3, 0, 4},
                           {3, 4, 7}}};
  const ShellMesh shell = shells_on(Target(cube), cube, Patch::watertight);
  ASSERT_EQ(shell.corner_normals.size(), 12u);
  const auto facets = facet_normals(cube);
  for (std::size_t t = 0; t < 12; ++t) {
    for (const Vec3& n : shell.corner_normals[t]) {
      EXPECT_LT((n - facets[t]).norm(), 1e-12);
    }
  }
}

TEST(Start, NodesWithoutACompatibleNormalGetOneForEachSide) {
  // Two squares, folded upon each other along a hinge: nothing agrees with both at its nodes.
  ShellMesh shell;
  shell.vertices = {{0, 0, 0}, {0, 1, 0}, {1, 1, 0.05}, {1, 0, 0.05}, {1, 1, -0.05}, {1, 0, -0.05}};
  shell.triangles = {{0, 3, 1}, {3, 2, 1}, {0, 1, 5}, {1, 4, 5}};
  take_normals_from(Target(flat_facets(shell)), shell);
  EXPECT_THROW(require_fit(shell, "folded"), InputError);
  const ShellMesh creased = creased_where_folded(shell);
  EXPECT_NO_THROW(require_fit(creased, "creased"));
  const auto facets = facet_normals(flat_facets(shell));
  for (const auto& [triangle, corner] : {std::pair(0, 0), {0, 2}, {1, 2}, {2, 0}, {2, 1}, {3, 0}}) {
    EXPECT_GT(creased.corner_normals[triangle][corner].dot(facets[triangle]), 0.9);
  }
}

TEST(Start, TopologyIsComponentsLoopsAndHandles) {
  const Target target(testing::sphere(3));
  EXPECT_TRUE(same_topology(testing::sphere(1), target));
  EXPECT_FALSE(same_topology(shapes::torus(24, 12), target));
  EXPECT_FALSE(same_topology(testing::cylinder(12, 4, 1, 2), target));
  EXPECT_FALSE(
      same_topology(shapes::together(testing::sphere(1), shapes::moved(testing::sphere(1), {5, 0, 0})), target));
}

TEST(Start, DecimationsComeNearTheErrorAskedFor) {
  TriangleMesh mesh = testing::sphere(6, 50);
  const Target target(mesh);
  const double few = static_cast<double>(decimation_within(target, 1).triangles.size());
  const double many = static_cast<double>(decimation_within(target, 0.25).triangles.size());
  EXPECT_GT(many / few, 2.5);
  EXPECT_LT(many / few, 6.5);
}

}  // namespace
}  // namespace tunica
