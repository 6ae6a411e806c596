// CGAL's Garland-Heckbert planes as the measure of decimation.
#include "bench/cgal_decimate.hpp"
#include "surface/checks.hpp"
#include "surface/decimated.hpp"
#include "surface/shapes.hpp"

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
  const std::vector<TriangleMesh> meshes{wavy_ball(), shapes::torus(60, 30), shapes::tube(40, 20),
                                         shapes::shaken(shapes::torus(60, 30), 0.02, 5)};
  for (const TriangleMesh& mesh : meshes) {
    const auto given = to_cgal<SimpleCgalMesh>(mesh);
    for (const double share : {0.3, 0.5, 0.75, 0.9}) {
      const auto count = static_cast<std::size_t>(share * static_cast<double>(mesh.triangles.size()));
      const double peer = distance(garland_heckbert(given, count), mesh);
      const DecimateResult own = decimated_to(mesh, count);
      EXPECT_LE(distance(own.mesh, mesh), 1.05 * peer + 1.1e-5 * diagonal(mesh)) << count;
      EXPECT_EQ(own.mesh.triangles.size(), count - count % 2);
      EXPECT_EQ(why_unfit(examine(own.mesh)), std::nullopt);
      EXPECT_EQ(examine(own.mesh).euler, examine(mesh).euler);
    }
  }
}

}  // namespace
}  // namespace tunica
