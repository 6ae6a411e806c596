#include "shell/fit.hpp"

#include "shell/curved_surface.hpp"
#include "shell/families.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_start.hpp"
#include "surface/checks.hpp"
#include "surface/decimate.hpp"
#include "surface/incidence.hpp"
#include "surface/measure.hpp"
#include "surface/self_intersections.hpp"

#include <Eigen/Geometry>

#include <gtest/gtest.h>

#include <cmath>

namespace tunica {
namespace {

RelaxOptions fitting() {
  RelaxOptions options;
  options.effort = 0.1;  // what these tests are about it does not change
  options.method = RelaxMethod::fit;
  return options;
}

/// A sphere with waves: smooth, closed, without symmetry.
TriangleMesh wavy(int times) {
  TriangleMesh mesh = testing::sphere(times);
  for (Vec3& p : mesh.vertices) {
    p *= 10 * (1 + 0.12 * std::sin(3 * p.x() + 1) * std::cos(2 * p.y()) + 0.05 * std::sin(5 * p.z() + 2 * p.x()));
  }
  return mesh;
}

/// An open tube with a bend, `around` by `along` cells.
TriangleMesh tube(int around, int along) {
  TriangleMesh mesh;
  for (int j = 0; j <= along; ++j) {
    const double s = static_cast<double>(j) / along;
    for (int i = 0; i < around; ++i) {
      const double a = 2 * 3.14159265358979323846 * i / around;
      const double r = 4 * (1 + 0.25 * std::exp(-30 * (s - 0.5) * (s - 0.5)));
      mesh.vertices.emplace_back(r * std::cos(a) + 6 * s * s, r * std::sin(a), 30 * s);
    }
  }
  for (int j = 0; j < along; ++j) {
    for (int i = 0; i < around; ++i) {
      const auto at = [&](int row, int column) { return static_cast<Index>(row * around + column % around); };
      mesh.triangles.push_back({at(j, i), at(j, i + 1), at(j + 1, i + 1)});
      mesh.triangles.push_back({at(j, i), at(j + 1, i + 1), at(j + 1, i)});
    }
  }
  return mesh;
}

/// A cube of n x n squares per side: creases and corners.
TriangleMesh cube(int n) {
  TriangleMesh mesh;
  std::map<std::array<int, 3>, Index> number;
  const auto at = [&](std::array<int, 3> p) {
    const auto [it, is_new] = number.try_emplace(p, static_cast<Index>(mesh.vertices.size()));
    if (is_new) {
      mesh.vertices.emplace_back(p[0], p[1], p[2]);
    }
    return it->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const int side : {0, n}) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int u, int v) {
            std::array<int, 3> p{};
            p[axis] = side;
            p[(axis + 1) % 3] = u;
            p[(axis + 2) % 3] = v;
            return at(p);
          };
          std::array<Index, 4> q{corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)};
          if (side == 0) {
            std::swap(q[1], q[3]);
          }
          mesh.triangles.push_back({q[0], q[1], q[2]});
          mesh.triangles.push_back({q[0], q[2], q[3]});
        }
      }
    }
  }
  return mesh;
}

std::size_t flat_triangles_for(const TriangleMesh& mesh, double error) {
  DecimateOptions options;
  options.max_error = error;
  return decimate(mesh, options).mesh.triangles.size();
}

TEST(Fit, JacobianIsTheDerivativeOfTheControlPoints) {
  const PatchShape shape{
      {Vec3(0, 0, 0), Vec3(2, 0.3, 0.1), Vec3(0.4, 1.5, -0.2)},
      {Vec3(0.2, -0.1, 1).normalized(), Vec3(-0.3, 0.1, 1).normalized(), Vec3(0, 0.3, 1).normalized()}};
  const PatchJacobian jacobian = patch_jacobian(shape);
  Eigen::Matrix<double, 15, 1> change;
  for (Eigen::Index i = 0; i < 15; ++i) {
    change[i] = std::sin(1.7 * static_cast<double>(i) + 0.3);
  }
  const auto moved = [&](double by) {
    PatchShape other = shape;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      other.corners[k] += by * change.segment<3>(3 * i);
      const auto axes = tilt_axes(shape.normals[k]);
      other.normals[k] += by * (change[9 + 2 * i] * axes[0] + change[10 + 2 * i] * axes[1]);
      other.normals[k].normalize();
    }
    return comas_patch(other.corners, other.normals);
  };
  const double step = 1e-4;
  const CubicPatch plus = moved(step), minus = moved(-step);
  for (std::size_t i = 0; i < 10; ++i) {
    const Vec3 slope = (plus.control[i] - minus.control[i]) / (2 * step);
    const Vec3 predicted = (jacobian * change).segment<3>(3 * static_cast<Eigen::Index>(i));
    EXPECT_LT((slope - predicted).norm(), 1e-5) << i;
  }
}

TEST(Fit, FootOnPatchIsTheClosestPoint) {
  const CubicPatch patch =
      comas_patch({Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(0.4, 1.5, 0)},
                  {Vec3(-0.3, -0.2, 1).normalized(), Vec3(0.3, -0.1, 1).normalized(), Vec3(0, 0.3, 1).normalized()});
  for (const Vec3& q : {Vec3(0.7, 0.5, 1), Vec3(0.8, 0.4, -0.5), Vec3(3, 0, 0), Vec3(-1, -1, 0.2), Vec3(0.5, 3, 0.5)}) {
    double least = 1e300;
    for (int i = 0; i <= 300; ++i) {
      for (int j = 0; i + j <= 300; ++j) {
        least = std::min(least, (patch.point(Vec2(i / 300.0, j / 300.0)) - q).norm());
      }
    }
    EXPECT_NEAR(std::sqrt(foot_on_patch(patch, q).squared_distance), least, 2e-3 + 0.01 * least);
  }
}

void expect_fewer_shells(const TriangleMesh& mesh, double percent, double times_fewer) {
  const Target target(mesh);
  RelaxOptions options = fitting();
  options.tolerance = percent / 100 * target.diagonal();
  const RelaxResult result = relax(mesh, target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, *options.tolerance);
  EXPECT_LE(times_fewer * static_cast<double>(result.shell.triangles.size()),
            static_cast<double>(flat_triangles_for(mesh, *options.tolerance)))
      << result.shell.triangles.size();
  EXPECT_NO_THROW(require_fit(result.shell, "fit"));
  // The certificate is that of the mesh that comes back.
  ShellDistanceOptions measuring;
  measuring.width = 1e-4 * target.diagonal();
  EXPECT_LE(shell_distance(result.shell, target, measuring).both.lower, result.distance.both.upper);
}

TEST(Fit, ClosedSurfaceNeedsAFractionOfTheFlatTriangles) { expect_fewer_shells(wavy(5), 0.3, 3.5); }
TEST(Fit, OpenTubeNeedsAFractionOfTheFlatTriangles) { expect_fewer_shells(tube(64, 80), 0.2, 3); }

TEST(Fit, KeepsTopologyAndAngles) {
  for (const TriangleMesh& mesh : {wavy(4), tube(48, 60)}) {
    const Target target(mesh);
    RelaxOptions options = fitting();
    options.tolerance = 0.003 * target.diagonal();
    const ShellMesh shell = relax(mesh, target, options).shell;
    const MeshFacts before = examine(mesh), after = examine(flat_facets(shell));
    EXPECT_FALSE(why_unfit(after)) << why_unfit(after).value_or("");
    EXPECT_EQ(after.components, before.components);
    EXPECT_EQ(after.boundary_loops, before.boundary_loops);
    EXPECT_EQ(after.euler, before.euler);
    EXPECT_GE(min_angle_degrees(flat_facets(shell)), 20);
    const Tessellation fine = tessellate_uniformly(shell, 4);
    EXPECT_EQ(count_self_intersections(fine.mesh, fine.shell, shell.triangles), 0U);
  }
}

/// A ball with a wall: two sheets `gap` apart, facing away from each other.
TriangleMesh walled_ball(int times, double gap) {
  TriangleMesh mesh = testing::sphere(times, 10);
  const std::size_t nodes = mesh.vertices.size();
  const auto outer = mesh.triangles;
  for (std::size_t v = 0; v < nodes; ++v) {
    mesh.vertices.emplace_back(mesh.vertices[v] * (1 - gap / 10));
  }
  for (const auto& [a, b, c] : outer) {
    const auto n = static_cast<Index>(nodes);
    mesh.triangles.push_back({a + n, c + n, b + n});
  }
  return mesh;
}

TEST(Fit, CrossingShellsAreParted) {
  // The sheets are 0.25 apart, so patches with errors of 0.35 cross.
  const TriangleMesh mesh = walled_ball(4, 0.25);
  const Target target(mesh);
  FitStart start;
  start.mesh = walled_ball(1, 0.25);
  for (std::size_t v = 0; v < start.mesh.vertices.size() / 2; v += 5) {
    start.mesh.vertices[v] *= 0.965;
  }
  const FitSamples samples(target, 160);
  FitState state(samples, prepare_fit(start, target), {});
  state.attach();
  state.measure();
  const std::size_t before = crossing_shells(state.mesh.shell()).size();
  EXPECT_GT(before, 5U);
  const double error = state.error();
  EXPECT_EQ(part_crossings(state, 0.35, 1000), 0U);
  EXPECT_EQ(crossing_shells(state.mesh.shell()).size(), 0U);
  EXPECT_LE(state.error(), std::max(error, 0.35));
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(Fit, PointsOfTheTargetFollowTheirPatches) {
  const TriangleMesh mesh = walled_ball(4, 1);
  const Target target(mesh);
  FitStart start;
  start.mesh = walled_ball(2, 1);
  const FitSamples samples(target, 640);
  FitState state(samples, prepare_fit(start, target), {});
  state.attach();
  for (std::size_t v = 0; v < state.mesh.positions.size(); ++v) {
    state.mesh.positions[v] +=
        0.1 * Vec3(std::sin(3.0 * static_cast<double>(v)), std::cos(7.0 * static_cast<double>(v)), 0);
  }
  FitState anew = state;
  state.attach_again();
  anew.attach();
  std::size_t points = 0, elsewhere = 0, moved = 0;
  FitState before(samples, prepare_fit(start, target), {});
  before.attach();
  for (std::size_t t = 0; t < state.patches.size(); ++t) {
    const auto &here = state.patches[t].attached, &there = anew.patches[t].attached, &then = before.patches[t].attached;
    points += here.size();
    for (const Index q : here) {
      elsewhere += std::find(there.begin(), there.end(), q) == there.end() ? 1 : 0;
      moved += std::find(then.begin(), then.end(), q) == then.end() ? 1 : 0;
    }
  }
  EXPECT_EQ(points, samples.points().size());
  EXPECT_GT(moved, points / 100);
  // attach() looks on flat pieces: points over an edge may differ.
  EXPECT_LT(elsewhere, moved / 2);
}

TEST(StartGrid, LeadsNearThePointWhereverTheSurfaceIs) {
  const TriangleMesh mesh = walled_ball(4, 1);
  const StartGrid grid(mesh);
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 7) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 p = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3;
    const auto near = grid.near(p);
    ASSERT_TRUE(near);
    EXPECT_LT((mesh.vertices[mesh.triangles[*near][0]] - p).norm(), 3 * grid.cell());
  }
  EXPECT_FALSE(grid.near(Vec3::Constant(1e9)));
  EXPECT_FALSE(grid.near(Vec3::Constant(std::nan(""))));
}

TEST(Fit, SheetsCloserThanTheToleranceDoNotCross) {
  const TriangleMesh mesh = walled_ball(3, 0.25);
  const Target target(mesh);
  RelaxOptions options = fitting();
  options.tolerance = 0.35;
  const RelaxResult result = relax(mesh, target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.distance.both.upper, 0.35);
  EXPECT_EQ(crossing_shells(result.shell).size(), 0U);
  EXPECT_LT(result.shell.triangles.size(), mesh.triangles.size() / 2);
}

TEST(Fit, GivenCountIsKeptAndMoreShellsAreCloser) {
  const TriangleMesh mesh = wavy(4);
  const Target target(mesh);
  double last = 1e300;
  for (const std::size_t shells : {60U, 200U}) {
    RelaxOptions options = fitting();
    options.shells = shells;
    options.max_iterations = 1;
    const RelaxResult result = relax(mesh, target, options);
    EXPECT_LE(result.shell.triangles.size(), shells);
    EXPECT_FALSE(result.reached.has_value());
    EXPECT_LT(result.distance.both.upper, 0.6 * last);
    last = result.distance.both.upper;
  }
}

TEST(Fit, WithoutACountItIsThatOfTheCoarseMesh) {
  const TriangleMesh coarse = testing::sphere(1, 11);
  RelaxOptions options = fitting();
  options.max_iterations = 1;
  const RelaxResult result = relax(coarse, Target(wavy(4)), options);
  EXPECT_LE(result.shell.triangles.size(), coarse.triangles.size());
  EXPECT_GE(result.shell.triangles.size(), coarse.triangles.size() - 2);
}

TEST(Fit, FlatFacetsAreTheBestShellsOfACube) {
  const TriangleMesh mesh = cube(12);
  const Target target(mesh);
  RelaxOptions options = fitting();
  options.tolerance = 0.001 * target.diagonal();
  const RelaxResult result = relax(mesh, target, options);
  EXPECT_EQ(result.reached, true);
  EXPECT_LE(result.shell.triangles.size(), 12U);
  EXPECT_EQ(result.shell.corner_normals.size(), result.shell.triangles.size());
}

TEST(Fit, CreasesOfTheTargetGetANormalForEachSide) {
  FitStart start;
  start.mesh = cube(3);
  const FitMesh mesh = prepare_fit(start, Target(cube(12)));
  std::vector<Index> slots;
  std::array<int, 4> nodes_with{};
  for (Index v = 0; v < mesh.positions.size(); ++v) {
    mesh.slots_of(v, slots);
    ASSERT_LE(slots.size(), 3U);
    ++nodes_with[slots.size()];
    for (const Index s : slots) {
      EXPECT_NEAR(mesh.normals[s].cwiseAbs().maxCoeff(), 1, 1e-12);
    }
  }
  EXPECT_EQ(nodes_with[3], 8);
  EXPECT_EQ(nodes_with[2], 12 * 2);
  EXPECT_EQ(nodes_with[1], 6 * 4);
}

TEST(Fit, CollapseStopsAtTheLimitAndAtTheSmallestMesh) {
  const Target target(testing::sphere(4));
  FitStart start;
  start.mesh = testing::sphere(2);
  start.flat_error = 0.05;
  const FitSamples samples(target, 100);
  FitState state(samples, prepare_fit(start, target), {});
  state.attach();
  state.measure();
  EXPECT_EQ(collapse_edges(state, 0, 4, {}), 0U);
  collapse_edges(state, 0.02, 4, {});
  state.attach();
  state.measure();
  EXPECT_LT(state.mesh.alive, start.mesh.triangles.size());
  EXPECT_LT(state.error(), 0.03);
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(Fit, SolveLessensTheCostAndTheError) {
  const Target target(wavy(4));
  FitStart start;
  start.mesh = testing::sphere(2, 10);
  start.flat_error = 1;
  const FitSamples samples(target, 320);
  FitState state(samples, prepare_fit(start, target), {});
  state.attach();
  state.measure();
  const double before = state.error();
  for (int i = 0; i < 6; ++i) {
    EXPECT_LE(state.solve(i < 3 ? 2 : 8, 1), 1);
    state.attach();
    state.measure();
  }
  EXPECT_LT(state.error(), before / 20);
}

TEST(Fit, ThinTrianglesAreMendedWithoutALargerError) {
  const Target target(testing::sphere(5));
  FitStart start;
  start.mesh = testing::sphere(2);
  start.flat_error = 0.05;
  for (const Index v : {20U, 70U, 110U}) {
    const Index to = start.mesh.triangles[incidence(start.mesh).of(v)[0]][0] == v
                         ? start.mesh.triangles[incidence(start.mesh).of(v)[0]][1]
                         : start.mesh.triangles[incidence(start.mesh).of(v)[0]][0];
    start.mesh.vertices[v] = (0.15 * start.mesh.vertices[v] + 0.85 * start.mesh.vertices[to]).normalized();
  }
  const FitSamples samples(target, 320);
  FitState state(samples, prepare_fit(start, target), {});
  state.attach();
  state.measure();
  EXPECT_GT(count_thin(state), 3U);
  const double before = state.error();
  EXPECT_EQ(mend_angles(state, 0), 0U);
  EXPECT_EQ(count_thin(state), 0U);
  EXPECT_LE(state.error(), 1.001 * before);
  EXPECT_EQ(state.mesh.alive, start.mesh.triangles.size());
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(Fit, SaysWhenTheToleranceNeedsMoreShellsThanAllowed) {
  const TriangleMesh mesh = wavy(4);
  RelaxOptions options = fitting();
  options.tolerance = 1e-3;
  options.shells = 40;
  const RelaxResult result = relax(mesh, Target(mesh), options);
  EXPECT_EQ(result.reached, false);
  EXPECT_LE(result.shell.triangles.size(), 40U);
  EXPECT_FALSE(result.shell.triangles.empty());
}

}  // namespace
}  // namespace tunica
