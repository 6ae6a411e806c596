#include "tunica/surface/mesh/tet_checks.hpp"

#include "surface/tet_shapes.hpp"
#include "tunica/core/error.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

namespace tunica {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string unsound(TetMesh mesh) {
  try {
    require_sound(mesh, "a.msh");
  } catch (const InputError& error) {
    return error.what();
  }
  return "sound";
}

TEST(TetChecks, SoundMeshStaysAsItIs) {
  TetMesh cube = shapes::tet_cube(2);
  const auto before = cube.tetrahedra;
  EXPECT_EQ(require_sound(cube, "a.msh"), 0U);
  EXPECT_EQ(cube.tetrahedra, before);
}

TEST(TetChecks, InsideOutTetrahedraAreTurned) {
  TetMesh cube = shapes::tet_cube(2);
  const double volume = shapes::volume(cube);
  for (std::size_t t = 0; t < cube.tetrahedra.size(); t += 3) {
    std::swap(cube.tetrahedra[t][0], cube.tetrahedra[t][1]);
  }
  EXPECT_LT(shapes::volume(cube), volume);
  EXPECT_EQ(require_sound(cube, "a.msh"), 16U);
  EXPECT_NEAR(shapes::volume(cube), volume, 1e-15);
}

TEST(TetChecks, UnsoundMeshesAreRefused) {
  const TetMesh cube = shapes::tet_cube(1);
  EXPECT_EQ(unsound({}), "a.msh: has no tetrahedra");
  TetMesh bad = cube;
  bad.tetrahedra[4][2] = 8;
  EXPECT_EQ(unsound(bad), "a.msh: tetrahedron 4 names vertex 8, but there are only 8");
  bad = cube;
  bad.tetrahedra[3][1] = bad.tetrahedra[3][2];
  EXPECT_THAT(unsound(bad), StartsWith("a.msh: tetrahedron 3 near (0, 0, 0) has no volume"));
  bad = cube;
  bad.vertices[5].y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(unsound(bad), "a.msh: vertex 5 lies at (1, nan, 1): coordinates must be finite");
}

TEST(TetChecks, FoldedMeshesAreRefused) {
  TetMesh folded{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)},
                 {{0, 1, 2, 3}, {0, 2, 1, 4}}};
  EXPECT_EQ(unsound(folded), "sound");
  folded.vertices[4].z() = 2;
  EXPECT_THAT(unsound(folded), StartsWith("a.msh: tetrahedra 0 and 1 near (0, 0, 0) lie on the same side of the face"));
}

TEST(TetChecks, NoHeightWithinRoundingIsNoVolume) {
  const auto slab = [](double height, double at, double size) {
    TetMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.3, 0.3, height}}, {{0, 1, 2, 3}}};
    for (Vec3& v : mesh.vertices) {
      v = size * v + Vec3::Constant(at);
    }
    return unsound(mesh);
  };
  EXPECT_EQ(slab(1e-9, 0, 1), "sound");
  EXPECT_EQ(slab(1e-9, 0, 1e-100), "sound") << "small is not flat";
  EXPECT_THAT(slab(0, 0, 1), HasSubstr("has no volume"));
  EXPECT_THAT(slab(0, 0.1, 0.7), HasSubstr("has no volume")) << "flat but for rounding";
  EXPECT_THAT(slab(3e-10, 1e6, 1), HasSubstr("has no volume")) << "below the spacing of the coordinates there";
}

TEST(TetChecks, BoundaryOfACubeIsClosedAndFacesOutward) {
  const TetMesh cube = shapes::tet_cube(3);
  const TriangleMesh boundary{cube.vertices, boundary_triangles(cube)};
  EXPECT_EQ(boundary.triangles.size(), 6U * 9 * 2);
  EXPECT_EQ(why_unfit(examine(boundary), Boundary::forbidden), std::nullopt);
  EXPECT_EQ(examine(boundary).euler, 2);
  EXPECT_NEAR(signed_volume(boundary), 1, 1e-14);
  EXPECT_NEAR(area(boundary), 6, 1e-13);
}

TEST(TetChecks, BoundaryIsInTheOrderOfTetrahedra) {
  const TetMesh two{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}, {{0, 1, 2, 3}, {1, 2, 3, 4}}};
  const std::vector<std::array<Index, 3>> expected = {{0, 3, 2}, {0, 1, 3}, {0, 2, 1}, {2, 3, 4}, {1, 4, 3}, {1, 2, 4}};
  EXPECT_EQ(boundary_triangles(two), expected);
}

TEST(TetChecks, ThreeTetrahedraAtAFaceAreRefused) {
  TetMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {2, 2, 2}},
               {{0, 1, 2, 3}, {4, 1, 3, 2}, {5, 1, 3, 2}}};
  try {
    boundary_triangles(mesh);
    FAIL() << "three tetrahedra share 1, 2, 3";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("3 tetrahedra share one face, the first are 0, 1 and 2: its corners are 1, 2 "
                                        "and 3"));
  }
}

TEST(TetChecks, DihedralAngles) {
  const TetMesh regular{{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}, {{0, 1, 2, 3}}};
  EXPECT_NEAR(smallest_dihedral(regular), std::acos(1.0 / 3) * 180 / std::numbers::pi, 1e-12);
  EXPECT_NEAR(smallest_dihedral(shapes::tet_cube(2)), 45, 1e-12);
  const TetMesh flat{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 1e-9}}, {{0, 1, 2, 3}}};
  EXPECT_LT(smallest_dihedral(flat), 1e-6);
  EXPECT_GT(smallest_dihedral(flat), 1e-8);
  EXPECT_EQ(smallest_dihedral({}), 180);
}

}  // namespace
}  // namespace tunica
