// CGAL's Garland-Heckbert planes as the measure of decimation.
#include "bench/cgal_decimate.hpp"
#include "surface/decimated.hpp"
#include "surface/shapes.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tunica {
namespace {

// A ball with waves of several lengths.
TriangleMesh wavy_ball() {
  TriangleMesh mesh = shapes::sphere(5);
  for (Vec3& p : mesh.vertices) {
    p *= 1 + 0.1 * std::sin(5 * p.x() + 1) * std::cos(4 * p.y()) + 0.05 * std::sin(9 * p.z() + 2 * p.x());
    p.z() *= 0.5;
  }
  return mesh;
}

// Nearly flat sides and rounded edges: sums of sixth powers.
TriangleMesh superellipsoid() {
  TriangleMesh mesh = shapes::sphere(5);
  for (Vec3& p : mesh.vertices) {
    p /= std::pow(p.array().pow(6).sum(), 1.0 / 6);
    p = p.cwiseProduct(Vec3(25, 18, 12));
  }
  return mesh;
}

// A body with a thin finger.
TriangleMesh finger() {
  TriangleMesh mesh = shapes::sphere(5);
  for (Vec3& p : mesh.vertices) {
    p = {20 * p.x(), 16 * p.y(), 18 * p.z() + 30 * std::exp((p.z() - 1) / 0.03)};
  }
  return mesh;
}

// Open, with curved edges.
TriangleMesh sheet() {
  TriangleMesh mesh = shapes::plane(80, 50, 60, 40);
  for (Vec3& p : mesh.vertices) {
    const double x = p.x() - 30;
    const double y = p.y() - 20;
    p.z() = 6 * std::sin(x / 9) * std::cos(y / 8) + 0.001 * x * x * y;
  }
  return mesh;
}

// Open at both ends, with a neck.
TriangleMesh bottle() {
  TriangleMesh mesh = shapes::tube(64, 70, 1, 80);
  for (Vec3& p : mesh.vertices) {
    const double radius = 2 + 14 / (1 + std::exp((p.z() / 80 - 0.5) * 22));
    p = {radius * p.x(), radius * p.y() * (1 + 0.1 * p.x()), p.z()};
  }
  return mesh;
}

TEST(Decimate, ErrorIsNoLargerThanCgals) {
  const std::vector<TriangleMesh> meshes{wavy_ball(), shapes::torus(60, 30), shapes::tube(40, 20),
                                         shapes::shaken(shapes::torus(60, 30), 0.02, 5)};
  for (const TriangleMesh& mesh : meshes) {
    const auto given = to_cgal<SimpleCgalMesh>(mesh);
    for (const std::size_t count : {std::size_t{120}, std::size_t{400}, std::size_t{1500}}) {
      const double peer = distance(garland_heckbert(given, count), mesh);
      EXPECT_LE(distance(decimated_to(mesh, count).mesh, mesh), 1.05 * peer + 1e-4 * diagonal(mesh)) << count;
    }
  }
}

TEST(Decimate, ErrorIsNoLargerThanCgalsWhereMuchStays) {
  const std::vector<TriangleMesh> meshes{wavy_ball(),
                                         shapes::torus(60, 30),
                                         shapes::tube(40, 20),
                                         shapes::shaken(shapes::torus(60, 30), 0.02, 5),
                                         superellipsoid(),
                                         finger(),
                                         sheet(),
                                         bottle()};
  for (const TriangleMesh& mesh : meshes) {
    const auto given = to_cgal<SimpleCgalMesh>(mesh);
    for (const double share : {0.3, 0.5, 0.75, 0.9}) {
      const auto count = static_cast<std::size_t>(share * static_cast<double>(mesh.triangles.size()));
      const double peer = distance(garland_heckbert(given, count), mesh);
      const DecimateResult own = decimated_to(mesh, count);
      EXPECT_LE(distance(own.mesh, mesh), 1.05 * peer + 1.1e-5 * diagonal(mesh)) << count;
      EXPECT_LE(own.mesh.triangles.size(), count);
      EXPECT_GE(own.mesh.triangles.size() + 2, count);
      EXPECT_EQ(why_unfit(examine(own.mesh)), std::nullopt);
      EXPECT_EQ(examine(own.mesh).euler, examine(mesh).euler);
    }
  }
}

}  // namespace
}  // namespace tunica
