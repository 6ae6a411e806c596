#include "surface/decimated.hpp"

#include "surface/shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace tunica {
namespace {

TriangleMesh decimated(const TriangleMesh& mesh, std::size_t triangles) {
  DecimateOptions options;
  options.triangles = triangles;
  DecimateResult result = decimate(mesh, options);
  EXPECT_TRUE(result.count_reached);
  return std::move(result.mesh);
}

void expect_same_topology(const TriangleMesh& before, const TriangleMesh& after) {
  const MeshFacts was = examine(before);
  const MeshFacts is = examine(after);
  EXPECT_TRUE(is.manifold && is.oriented);
  EXPECT_EQ(is.euler, was.euler);
  EXPECT_EQ(is.components, was.components);
  EXPECT_EQ(is.boundary_loops, was.boundary_loops);
  EXPECT_EQ(is.degenerate_triangles, 0U);
  EXPECT_EQ(is.unused_vertices, 0U);
}

// A mesh like marching cubes of a noisy mask: many short steps and narrow valleys.
TriangleMesh rough(std::uint32_t seed) { return shapes::shaken(shapes::torus(80, 40, 3, 1), 0.05, seed); }

TEST(Decimate, KeepsTheTopologyOfEveryKindOfSurface) {
  const std::vector<TriangleMesh> meshes{
      shapes::sphere(5),
      shapes::torus(60, 30),
      shapes::tube(50, 40),
      shapes::plane(30, 40),
      rough(1),
      shapes::together(shapes::sphere(3), shapes::moved(shapes::tube(20, 9), {5, 0, 0})),
      shapes::tetrahedron(),
  };
  for (const TriangleMesh& mesh : meshes) {
    for (const std::size_t count : {std::size_t{1000}, std::size_t{300}, std::size_t{80}}) {
      const TriangleMesh coarse = decimated(mesh, count);
      EXPECT_LE(coarse.triangles.size(), count);
      EXPECT_GE(coarse.triangles.size() + 2, std::min(count, mesh.triangles.size()));
      expect_same_topology(mesh, coarse);
    }
  }
}

TEST(Decimate, EndsAtTheFewestTrianglesOfTheTopology) {
  DecimateOptions options;
  options.triangles = 1;
  const auto fewest = [&](const TriangleMesh& mesh) {
    const DecimateResult result = decimate(mesh, options);
    expect_same_topology(mesh, result.mesh);
    EXPECT_EQ(result.count_reached, result.mesh.triangles.size() <= 1);
    return result.mesh.triangles.size();
  };
  EXPECT_EQ(fewest(shapes::sphere(3)), 4U);
  EXPECT_EQ(fewest(shapes::together(shapes::sphere(2), shapes::moved(shapes::sphere(2), {5, 0, 0}))), 8U);
  EXPECT_LE(fewest(shapes::plane(10, 10)), 2U);
  EXPECT_LE(fewest(shapes::torus(20, 10)), 30U);  // 14 is the least of any torus, flat folds forbidden
  EXPECT_LE(fewest(shapes::tube(12, 8)), 12U);
}

TEST(Decimate, SphereErrorFallsAsOneOverTheCount) {
  const TriangleMesh sphere = shapes::sphere(6);
  const double coarse = distance(decimated(sphere, 200), sphere);
  const double fine = distance(decimated(sphere, 1600), sphere);
  const double order = std::log(coarse / fine) / std::log(8.0);
  EXPECT_GT(order, 0.75);
  EXPECT_LT(order, 1.25);
  // An optimal mesh of N triangles is about 4.8 / N off the unit sphere; greedy ones within three times that.
  EXPECT_LT(coarse, 3 * 4.8 / 200);
}

TEST(Decimate, NoTriangleTurnsOver) {
  for (const TriangleMesh& mesh : {shapes::sphere(5), shapes::shaken(shapes::sphere(5), 0.01, 4)}) {
    for (const std::size_t count : {std::size_t{2000}, std::size_t{400}, std::size_t{60}}) {
      const TriangleMesh coarse = decimated(mesh, count);
      for (const auto& [i, j, k] : coarse.triangles) {
        const Vec3& a = coarse.vertices[i];
        const Vec3 normal = (coarse.vertices[j] - a).cross(coarse.vertices[k] - a).normalized();
        const Vec3 centroid = (a + coarse.vertices[j] + coarse.vertices[k]) / 3;
        EXPECT_GT(normal.dot(centroid.normalized()), 0);
      }
    }
  }
}

TEST(Decimate, RimsTakeNoMoreThanTheirShareOfTheVertices) {
  // The rim of a saddle turns as much as what lies within. CGAL's planes leave 0.7 to 0.9 and 0.36 % there.
  TriangleMesh saddle = shapes::plane(90, 80);
  for (Vec3& p : saddle.vertices) {
    const double x = 2 * p.x() - 1, y = 2 * p.y() - 1;
    p = {50 * x, 40 * y, 30 * (x * x - y * y) + 4 * std::sin(6 * p.x() + 3 * p.y())};
  }
  EXPECT_LE(distance(decimated(saddle, 100), saddle), 0.0090 * diagonal(saddle));
  EXPECT_LE(distance(decimated(saddle, 200), saddle), 0.0036 * diagonal(saddle));
}

TEST(Decimate, BoundaryVerticesStayOnTheBoundaryCurve) {
  const TriangleMesh tube = shapes::shaken(shapes::tube(60, 30), 0.003, 8);
  const TriangleMesh coarse = decimated(tube, 200);
  TriangleMesh curve;  // the boundary edges as triangles without area
  for (const auto& loop : boundary_loops(tube)) {
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const auto first = static_cast<Index>(curve.vertices.size());
      const Vec3& a = tube.vertices[loop[i]];
      const Vec3& b = tube.vertices[loop[(i + 1) % loop.size()]];
      curve.vertices.insert(curve.vertices.end(), {a, b, b});
      curve.triangles.push_back({first, first + 1, first + 2});
    }
  }
  const ClosestPoint tree(curve);
  std::size_t vertices = 0;
  for (const auto& loop : boundary_loops(coarse)) {
    EXPECT_GE(loop.size(), 3U);
    for (const Index v : loop) {
      EXPECT_LT(std::sqrt(tree.closest(coarse.vertices[v]).squared_distance), 1e-12);
      ++vertices;
    }
  }
  EXPECT_LT(vertices, 100U);  // of 120: the noise of the rim counts as shape
}

TEST(Decimate, FlatCornersAndRimsStayExact) {
  const TriangleMesh plane = shapes::plane(20, 30, 2, 3);
  const TriangleMesh coarse = decimated(plane, 2);
  EXPECT_EQ(coarse.triangles.size(), 2U);
  EXPECT_LT(distance(coarse, plane), 1e-4);
  EXPECT_NEAR(area(coarse), 6, 1e-9);
}

TEST(Decimate, MaxErrorIsHonouredBothWays) {
  const std::vector<TriangleMesh> meshes{shapes::sphere(4), shapes::torus(50, 25), shapes::tube(40, 20), rough(3)};
  for (const TriangleMesh& mesh : meshes) {
    std::size_t previous = mesh.triangles.size() + 1;
    for (const double relative : {0.001, 0.005, 0.03}) {
      DecimateOptions options;
      options.max_error = relative * diagonal(mesh);
      const DecimateResult result = decimate(mesh, options);
      ASSERT_TRUE(result.error_kept);
      EXPECT_LE(result.error->upper, *options.max_error);
      EXPECT_LE(distance(result.mesh, mesh), *options.max_error + 1.1e-5 * diagonal(mesh));
      EXPECT_LE(result.mesh.triangles.size(), previous);
      previous = result.mesh.triangles.size();
      expect_same_topology(mesh, result.mesh);
    }
    EXPECT_LT(previous, mesh.triangles.size() / 4);
  }
}

TEST(Decimate, LevellingLetsFewerTrianglesKeepTheError) {
  for (const TriangleMesh& mesh : {shapes::sphere(5), shapes::shaken(shapes::torus(60, 30), 0.01, 3)}) {
    DecimateOptions options;
    options.max_error = 0.01 * diagonal(mesh);
    const DecimateResult levelled = decimate(mesh, options);
    options.levelled = false;
    const DecimateResult plain = decimate(mesh, options);
    EXPECT_TRUE(levelled.error_kept && plain.error_kept);
    EXPECT_LE(distance(levelled.mesh, mesh), 1.001 * *options.max_error);
    EXPECT_LT(levelled.mesh.triangles.size(), 0.9 * static_cast<double>(plain.mesh.triangles.size()));
    EXPECT_EQ(examine(levelled.mesh).euler, examine(mesh).euler);
  }
}

TEST(Decimate, MaxErrorWinsOverTheCount) {
  const TriangleMesh mesh = shapes::sphere(4);
  DecimateOptions options;
  options.triangles = 20;
  options.max_error = 0.005;
  const DecimateResult result = decimate(mesh, options);
  EXPECT_FALSE(result.count_reached);
  EXPECT_TRUE(result.error_kept);
  EXPECT_LE(result.error->upper, 0.005);
  options.triangles = 1500;
  const DecimateResult both = decimate(mesh, options);
  EXPECT_TRUE(both.count_reached && both.error_kept);
  EXPECT_EQ(both.mesh.triangles.size(), 1500U);
}

TEST(Decimate, ImpossibleErrorIsSaid) {
  DecimateOptions options;
  options.max_error = 1e-300;
  EXPECT_FALSE(decimate(shapes::sphere(2), options).error_kept);
}

TEST(Decimate, UnitAndPlaceChangeNothing) {
  const TriangleMesh mesh = shapes::shaken(shapes::sphere(4), 0.01, 2);
  const TriangleMesh coarse = decimated(mesh, 300);
  for (const double scale : {1.0 / 1024, 1048576.0}) {  // powers of two: coordinates scale without rounding
    EXPECT_EQ(decimated(shapes::moved(mesh, Vec3::Zero(), scale), 300).triangles, coarse.triangles);
  }
}

TEST(Decimate, UnfitMeshesAreRefusedWithThePlace) {
  DecimateOptions options;
  options.triangles = 10;
  const auto message = [&](const TriangleMesh& mesh) {
    try {
      decimate(mesh, options);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  TriangleMesh flipped = shapes::sphere(2);
  std::swap(flipped.triangles[9][0], flipped.triangles[9][1]);
  EXPECT_THAT(message(flipped), testing::HasSubstr("face opposite ways"));
  TriangleMesh fin = shapes::sphere(2);
  fin.vertices.emplace_back(3, 3, 3);
  fin.triangles.push_back({fin.triangles[0][0], fin.triangles[0][1], static_cast<Index>(fin.vertices.size() - 1)});
  EXPECT_THAT(message(fin), testing::HasSubstr("shared by three"));
  TriangleMesh double_sided{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{{0, 1, 2}}, {{0, 2, 1}}}};
  EXPECT_THAT(message(double_sided), testing::HasSubstr("there twice"));
  TriangleMesh touching = shapes::together(shapes::sphere(1), shapes::moved(shapes::sphere(1), {9, 0, 0}));
  const auto second = static_cast<Index>(shapes::sphere(1).vertices.size());
  for (auto& triangle : touching.triangles) {
    std::replace(triangle.begin(), triangle.end(), second, Index{0});
  }
  EXPECT_THAT(message(touching), testing::HasSubstr("only touch there"));
  TriangleMesh nowhere = shapes::sphere(2);
  nowhere.vertices[3].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(nowhere), testing::HasSubstr("not finite"));
  TriangleMesh huge = shapes::sphere(2);
  for (Vec3& v : huge.vertices) {
    v *= 1e308;
  }
  EXPECT_THAT(message(huge), testing::HasSubstr("too far apart"));
  EXPECT_THAT(message({}), testing::HasSubstr("no triangles"));
  EXPECT_THAT(message({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{{0, 1, 2}}}}), testing::HasSubstr("one point"));
}

TEST(Decimate, TrianglesWithoutAreaInTheInputAreNoObstacle) {
  TriangleMesh mesh = shapes::sphere(4);
  // Three vertices of a triangle fall together, as clean-up tools leave them.
  const auto triangle = mesh.triangles[100];
  mesh.vertices[triangle[1]] = mesh.vertices[triangle[0]];
  mesh.vertices[triangle[2]] = mesh.vertices[triangle[0]];
  const TriangleMesh coarse = decimated(mesh, 200);
  EXPECT_LE(coarse.triangles.size(), 200U);
  EXPECT_LT(distance(coarse, mesh), 0.1);
}

TEST(Decimate, ACountOutOfReachDoesNotWorsenWhatAnErrorAllows) {
  const TriangleMesh mesh = shapes::torus(60, 30);
  DecimateOptions options;
  options.max_error = 2e-4 * diagonal(mesh);
  const std::size_t fewest = decimate(mesh, options).mesh.triangles.size();
  options.triangles = 10;
  const DecimateResult both = decimate(mesh, options);
  EXPECT_FALSE(both.count_reached);
  EXPECT_TRUE(both.error_kept);
  EXPECT_LE(static_cast<double>(both.mesh.triangles.size()), 1.02 * static_cast<double>(fewest));
}

}  // namespace
}  // namespace tunica
