#include "tunica/fit/fit.hpp"

#include "shell/families.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <random>

namespace tunica {
namespace {

ShellMesh bare(const TriangleMesh& mesh) { return {mesh.vertices, mesh.triangles, {}, {}, Patch::comas}; }

/// A box with rounded look at the finest level only: all edges are creases for coarse shells.
TriangleMesh spiky_ball() {
  TriangleMesh mesh = testing::sphere(1);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    mesh.vertices[v] *= v % 3 == 0 ? 2.2 : 1;
  }
  return mesh;
}

TEST(FitNormals, StayCompatibleOnASpikyMeshThroughTheFit) {
  const TriangleMesh mesh = spiky_ball();
  const Target target(mesh);
  ShellMesh shell = bare(mesh);
  ASSERT_TRUE(take_normals_from(target, shell).empty());
  EXPECT_NO_THROW(require_fit(shell, "taken"));
  fit_normals(target, shell);
  EXPECT_NO_THROW(require_fit(shell, "fitted"));
}

TEST(FitNormals, FitBringsTheCurvedSurfaceCloserAndNeverFartherBySamples) {
  // Normals of a sphere, disturbed by up to 20 degrees.
  const Target target(testing::sphere(5));
  ShellMesh shell = testing::sphere_shell(1);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.35, 0.35);
  for (Vec3& n : shell.normals) {
    n = (n + Vec3(uniform(random), uniform(random), uniform(random))).normalized();
  }
  ShellDistanceOptions options;
  options.width = 1e-3;
  const double before = shell_distance(shell, target, options).both.upper;
  fit_normals(target, shell);
  const double after = shell_distance(shell, target, options).both.upper;
  const double exact = shell_distance(testing::sphere_shell(1), target, options).both.upper;
  EXPECT_LT(after, before / 3);
  EXPECT_LT(after, 1.2 * exact);
}

TEST(FitNormals, FitDoesNotDependOnTheNumberOfThreads) {
  const Target target(testing::sphere(4));
  const auto fitted = [&](std::size_t threads) {
    set_thread_count(threads);
    ShellMesh shell = bare(testing::sphere(1));
    for (Vec3& p : shell.vertices) {
      p.x() *= 1.01;
    }
    take_normals_from(target, shell);
    fit_normals(target, shell);
    set_thread_count(default_thread_count());
    return shell.normals;
  };
  EXPECT_EQ(fitted(1), fitted(4));
}

}  // namespace
}  // namespace tunica
