#include "tunica/surface/filling/fill.hpp"

#include "surface/shapes.hpp"
#include "surface/tet_shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>

namespace tunica {
namespace {

using shapes::sphere;
using testing::HasSubstr;

template <typename Kind>
std::string message_of_fill(const TriangleMesh& surface, double size) {
  try {
    fill(surface, size);
  } catch (const Kind& error) {
    return error.what();
  }
  return "no such error";
}

double mean_edge(const TetMesh& mesh) {
  std::set<std::pair<Index, Index>> edges;
  for (const auto& tet : mesh.tetrahedra) {
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        edges.insert(std::minmax(tet[i], tet[j]));
      }
    }
  }
  double sum = 0;
  for (const auto& [i, j] : edges) {
    sum += (mesh.vertices[i] - mesh.vertices[j]).norm();
  }
  return sum / static_cast<double>(edges.size());
}

TriangleMesh boundary_of(const TetMesh& mesh) { return {mesh.vertices, boundary_triangles(mesh)}; }

// A box with sharp edges, from the origin.
TriangleMesh box(const Vec3& size) {
  TriangleMesh mesh;
  for (int v = 0; v < 8; ++v) {
    mesh.vertices.emplace_back(size.cwiseProduct(Vec3(v & 1, v >> 1 & 1, v >> 2)));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TriangleMesh reversed(TriangleMesh mesh) {
  for (auto& corners : mesh.triangles) {
    std::swap(corners[1], corners[2]);
  }
  return mesh;
}

TEST(Fill, SphereIsFilledWithGoodTetrahedraOfTheSize) {
  const TriangleMesh surface = sphere(4, 10);
  const TetMesh mesh = fill(surface, 2);
  EXPECT_NEAR(shapes::volume(mesh), signed_volume(surface), 0.02 * signed_volume(surface));
  EXPECT_GE(smallest_dihedral(mesh), 8);
  EXPECT_NEAR(mean_edge(mesh), 2, 0.2);
  const TriangleMesh boundary = boundary_of(mesh);
  EXPECT_EQ(why_unfit(examine(boundary), Boundary::forbidden), std::nullopt);
  EXPECT_NEAR(signed_volume(boundary), shapes::volume(mesh), 1e-9);
  for (const auto& corners : boundary.triangles) {
    for (const Index v : corners) {
      EXPECT_NEAR(mesh.vertices[v].norm(), 10, 0.05) << "vertices lie on the surface";
    }
  }
}

TEST(Fill, TheSameSurfaceGivesTheSameMesh) {
  const TriangleMesh surface = shapes::torus(32, 16, 6, 2);
  const TetMesh once = fill(surface, 1);
  // Other addresses, another state of whatever is remembered between calls.
  std::vector<std::unique_ptr<char[]>> clutter;
  for (std::size_t i = 1; i < 500; ++i) {
    clutter.push_back(std::make_unique<char[]>(97 * i));
    if (i % 3 == 0) {
      clutter[i / 2].reset();
    }
  }
  fill(sphere(2, 3), 1);
  const TetMesh again = fill(surface, 1);
  ASSERT_EQ(once.tetrahedra, again.tetrahedra);
  ASSERT_EQ(once.vertices, again.vertices) << "bit by bit";
  EXPECT_GE(smallest_dihedral(once), 8);
}

TEST(Fill, SharpEdgesAreKept) {
  const TetMesh mesh = fill(box({10, 6, 4}), 1.5);
  EXPECT_NEAR(shapes::volume(mesh), 240, 1e-9);
  EXPECT_GE(smallest_dihedral(mesh), 8);
  EXPECT_NEAR(mean_edge(mesh), 1.5, 0.3);
}

TEST(Fill, SurfacesWithinOthersAreCavitiesWhicheverWayTheyFace) {
  const double volume = signed_volume(sphere(4, 10)) - signed_volume(sphere(3, 5));
  for (const TriangleMesh& inner : {sphere(3, 5), reversed(sphere(3, 5))}) {
    for (const TriangleMesh& outer : {sphere(4, 10), reversed(sphere(4, 10))}) {
      const TetMesh mesh = fill(shapes::together(outer, inner), 2);
      EXPECT_NEAR(shapes::volume(mesh), volume, 0.02 * volume);
      EXPECT_EQ(examine(boundary_of(mesh)).components, 2U);
    }
  }
}

TEST(Fill, NoPieceIsMissed) {
  const auto pieces_of_fill = [](const TriangleMesh& surface) {
    return examine(without_unused(boundary_of(fill(surface, 2)))).components;
  };
  const TriangleMesh large = sphere(4, 10);
  EXPECT_EQ(pieces_of_fill(shapes::together(large, shapes::moved(sphere(3, 1), {20, 0, 0}))), 2U);
  EXPECT_EQ(pieces_of_fill(shapes::together(large, shapes::moved(box({5, 5, 5}), {20, 0, 0}))), 2U);
}

TEST(Fill, FarFromTheOriginAndWithUnusedVertices) {
  TriangleMesh surface = shapes::moved(sphere(3, 10), {1000, -500, 300});
  surface.vertices.insert(surface.vertices.begin(), Vec3(1e6, 0, 0));
  for (auto& corners : surface.triangles) {
    for (Index& v : corners) {
      ++v;
    }
  }
  const TetMesh mesh = fill(surface, 3);
  EXPECT_NEAR(shapes::volume(mesh), signed_volume(surface), 0.04 * signed_volume(surface));
}

TEST(Fill, RefusesWhatCannotBeFilled) {
  EXPECT_THAT(message_of_fill<InputError>(shapes::tube(12, 4), 1), HasSubstr("24 edges have a triangle on one side"));
  EXPECT_THAT(message_of_fill<InputError>({}, 1), HasSubstr("has no triangles"));
  const TriangleMesh crossing = shapes::together(sphere(2), shapes::moved(sphere(2), {1, 0, 0}));
  EXPECT_THAT(message_of_fill<InputError>(crossing, 0.5), HasSubstr("pairs of triangles touch or cross"));
  for (const double size : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), infinity}) {
    EXPECT_THAT(message_of_fill<InputError>(sphere(2), size), HasSubstr("must be greater than zero"));
  }
  EXPECT_THAT(message_of_fill<InputError>(sphere(2), 1e-4), HasSubstr("choose a larger size"));
  EXPECT_THAT(message_of_fill<RequirementError>(sphere(3, 10), 30), HasSubstr("choose a smaller size"));
  const TriangleMesh shell = shapes::together(sphere(3, 10), sphere(3, 9.8));
  EXPECT_THAT(message_of_fill<RequirementError>(shell, 8), HasSubstr("choose a smaller size"));
}

}  // namespace
}  // namespace tunica
