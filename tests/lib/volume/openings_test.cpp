#include "tunica/volume/cubes/openings.hpp"

#include "mesh_check.hpp"
#include "tunica/core/error.hpp"
#include "tunica/volume/cubes/doubts.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/cubes/outward.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "volumes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace tunica {
namespace {

using test::label_one;
using test::make_volume;

using Affine = Eigen::Matrix<double, 3, 4>;

/// Voxels within a distance of a line, in mm.
Mask vessel(const std::array<std::size_t, 3>& dims, const Vec3& point, const Vec3& along, double radius,
            const Affine& affine = Affine::Identity()) {
  Volume volume = make_volume<std::uint8_t>(dims, [&](auto i, auto j, auto k) {
    const Vec3 index(static_cast<double>(i), static_cast<double>(j), static_cast<double>(k));
    const Vec3 from = affine.leftCols<3>() * index + affine.col(3) - point;
    return from.cross(along.normalized()).norm() < radius;
  });
  volume.affine = affine;
  return select(volume, label_one);
}

struct Opened {
  Openings openings;
  TriangleMesh mesh;
};

Opened opened(const Mask& mask) {
  MarchingCubesOptions options;
  options.open_border = true;
  Opened result{find_openings(mask, marching_cubes(mask, options)), {}};
  options.lids = &result.openings.lids;
  result.mesh = marching_cubes(mask, options);
  const auto check = test::check_mesh(result.mesh);
  EXPECT_TRUE(check.manifold());
  EXPECT_EQ(check.coincident_vertices, 0U);
  EXPECT_GT(check.least_area, 0);
  EXPECT_TRUE(faces_outward(result.mesh, mask, true));
  return result;
}

std::size_t ends(const Openings& openings) {
  return static_cast<std::size_t>(std::ranges::count_if(openings.openings, &Opening::is_end));
}

/// The planes (axis, sign) in which edges of the boundary lie alone.
std::set<int> planes_of_boundary(const TriangleMesh& mesh, const std::array<std::size_t, 3>& dims) {
  std::set<std::pair<Index, Index>> edges;
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      if (edges.erase({t[(i + 1) % 3], t[i]}) == 0) {
        edges.insert({t[i], t[(i + 1) % 3]});
      }
    }
  }
  std::set<int> planes;
  for (const auto& [a, b] : edges) {
    const Vec3 middle = (mesh.vertices[a] + mesh.vertices[b]) / 2;
    std::set<int> its;
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(middle[axis] + 0.5) < 1e-9) {
        its.insert(2 * axis);
      }
      if (std::abs(middle[axis] - static_cast<double>(dims[axis]) + 0.5) < 1e-9) {
        its.insert(2 * axis + 1);
      }
    }
    EXPECT_FALSE(its.empty());
    if (its.size() == 1) {
      planes.insert(*its.begin());
    }
  }
  return planes;
}

TEST(Openings, OfVesselsThatLeaveTheImageAreEnds) {
  for (const double lean : {0.0, 0.4, 0.9}) {
    const Mask mask = vessel({61, 31, 24}, {30, 15, 12}, {lean, 0.2 * lean, 1}, 8);
    const Opened result = opened(mask);
    EXPECT_EQ(result.openings.openings.size(), 2U) << lean;
    EXPECT_EQ(ends(result.openings), 2U) << lean;
    EXPECT_FALSE(result.openings.lids.any());
  }
  EXPECT_EQ(ends(opened(vessel({31, 31, 2}, {15, 15, 0}, {0, 0, 1}, 8)).openings), 2U);
  // A wall cut across, a ball cut in half, and a vessel in long voxels of a mirrored image.
  const Mask ring = select(
      make_volume<std::uint8_t>(
          {31, 31, 20}, [](double x, double y, double) { return std::abs(std::hypot(x - 15, y - 15) - 10) < 1.5; }),
      label_one);
  EXPECT_EQ(ends(opened(ring).openings), 2U);
  const Mask ball =
      select(make_volume<std::uint8_t>({31, 31, 16},
                                       [](double x, double y, double z) { return std::hypot(x - 15, y - 15, z) < 11; }),
             label_one);
  EXPECT_EQ(ends(opened(ball).openings), 1U);
  Affine affine;
  affine << -0.7, 0, 0.4, 3, 0, 0.7, 0, -5, 0, 0.1, 2.5, 7;
  const Mask thick =
      vessel({41, 41, 12}, affine.leftCols<3>() * Vec3(20, 20, 6) + affine.col(3), affine.col(2), 7, affine);
  EXPECT_EQ(ends(opened(thick).openings), 2U);
}

TEST(Openings, ThroughASideAreClosedByLids) {
  const std::array<std::size_t, 3> dims{31, 31, 40};
  for (const double centre : {4.0, 0.0, -4.0}) {
    const Mask mask = vessel(dims, {centre, 15, 20}, {0, 0, 1}, 11);
    const Opened result = opened(mask);
    ASSERT_EQ(result.openings.openings.size(), 3U);
    EXPECT_EQ(ends(result.openings), 2U) << centre;
    const auto side = std::ranges::find(result.openings.openings, false, &Opening::is_end);
    EXPECT_EQ(side->axis, 0);
    EXPECT_FALSE(side->upper);
    EXPECT_LT((side->middle - Vec3(-0.5, 15, 19.5)).norm(), 1e-9);
    EXPECT_EQ(planes_of_boundary(result.mesh, dims), (std::set<int>{4, 5}));
    EXPECT_EQ(test::check_mesh(result.mesh).euler, 0);  // a tube
  }
  const Mask upper = vessel(dims, {15, 26, 20}, {0, 0, 1}, 11);
  EXPECT_EQ(planes_of_boundary(opened(upper).mesh, dims), (std::set<int>{4, 5}));
  const Mask corner = vessel(dims, {4, 4, 20}, {0, 0, 1}, 11);
  EXPECT_EQ(ends(opened(corner).openings), 2U);
  EXPECT_EQ(planes_of_boundary(opened(corner).mesh, dims), (std::set<int>{4, 5}));
  for (int axis = 0; axis < 2; ++axis) {
    const Mask lying = vessel(dims, {15, 15, 36}, Vec3::Unit(axis), 8);
    EXPECT_EQ(ends(opened(lying).openings), 2U) << axis;
    EXPECT_EQ(planes_of_boundary(opened(lying).mesh, dims), (std::set<int>{2 * axis, 2 * axis + 1}));
  }
}

TEST(Openings, ThatShaveOffADomeAreClosed) {
  const Mask dome =
      select(make_volume<std::uint8_t>(
                 {41, 41, 25}, [](double x, double y, double z) { return std::hypot(x - 20, y - 20, z - 8) < 18; }),
             label_one);
  const Opened result = opened(dome);
  EXPECT_EQ(ends(result.openings), 1U);  // below, where it is wide, but not above
  EXPECT_EQ(planes_of_boundary(result.mesh, {41, 41, 25}), std::set<int>{4});
}

TEST(Openings, ThroughTheBendOfAVesselAreClosed) {
  const Mask arch = select(make_volume<std::uint8_t>({60, 60, 60},
                                                     [](double x, double y, double z) {
                                                       const double across = std::abs(x - 30) - 16;
                                                       const double off =
                                                           z > 40 ? std::hypot(x - 30, z - 40) - 16 : across;
                                                       return std::hypot(off, y - 30) < 7;
                                                     }),
                           label_one);
  const Opened result = opened(arch);
  EXPECT_EQ(result.openings.openings.size(), 3U);
  EXPECT_EQ(ends(result.openings), 2U);
  EXPECT_EQ(planes_of_boundary(result.mesh, {60, 60, 60}), std::set<int>{4});
}

TEST(Openings, LidsLieOnTheBorderOfAMeshByValuesToo) {
  const std::array<std::size_t, 3> dims{21, 31, 20};
  const Volume volume =
      make_volume<float>(dims, [](double x, double y, double) { return 9 - std::hypot(x - 3, y - 15); });
  const Mask mask = select(volume, test::above(0));
  MarchingCubesOptions options;
  options.open_border = true;
  const Openings openings = find_openings(mask, marching_cubes(volume, test::above(0), mask, options));
  options.lids = &openings.lids;
  const TriangleMesh mesh = marching_cubes(volume, test::above(0), mask, options);
  EXPECT_TRUE(test::check_mesh(mesh).manifold());
  EXPECT_EQ(planes_of_boundary(mesh, dims), (std::set<int>{4, 5}));
  EXPECT_EQ(test::check_mesh(mesh).euler, 0);
}

TEST(Openings, LidsStayFlatWhenTheStaircaseIsSmoothed) {
  const Mask mask = vessel({31, 31, 40}, {4, 15, 20}, {0, 0, 1}, 11);
  Opened result = opened(mask);
  const TriangleMesh before = result.mesh;
  StaircaseOptions options;
  options.open_border = true;
  smooth_staircase(result.mesh, mask, options);
  std::size_t on_lid = 0;
  for (std::size_t v = 0; v < before.vertices.size(); ++v) {
    if (std::abs(before.vertices[v].x() + 0.5) < 1e-9) {
      EXPECT_NEAR(result.mesh.vertices[v].x(), -0.5, 1e-9);
      ++on_lid;
    }
  }
  EXPECT_GT(on_lid, 500U);
  EXPECT_TRUE(test::check_mesh(result.mesh).manifold());
}

TEST(Openings, AMeshOfAnotherMakeIsRefused) {
  const Mask mask = vessel({9, 9, 9}, {4, 4, 4}, {0, 0, 1}, 3);
  EXPECT_THROW(find_openings(mask, {{Vec3::Zero()}, {{0, 1, 2}}}), InputError);
}

TEST(Doubts, OfRimsNameTheirPlacesAndFaces) {
  const Subject subject{"label 1", false};
  MarchingCubesOptions options;
  options.open_border = true;
  const Mask mask = vessel({21, 21, 20}, {10, 10, 10}, {0, 0, 1}, 1.0);
  const TriangleMesh mesh = marching_cubes(mask, options);
  // Loops by hand: the vertices on each end.
  std::vector<std::vector<Index>> rims(2);
  for (Index v = 0; v < mesh.vertices.size(); ++v) {
    if (std::abs(mesh.vertices[v].z() + 0.5) < 1e-9) {
      rims[0].push_back(v);
    } else if (std::abs(mesh.vertices[v].z() - 19.5) < 1e-9) {
      rims[1].push_back(v);
    }
  }
  const auto found = doubt_rims(subject, mask, mesh, rims);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].kind, "narrow opening");
  EXPECT_NE(found[0].text.find("(10.0, 10.0, -0.5) mm, (10.0, 10.0, 19.5) mm"), std::string::npos) << found[0].text;
  EXPECT_EQ((Subject{"label 1", true}.at({1, 2, 3})), "(-1.0, -2.0, 3.0) mm");
}

}  // namespace
}  // namespace tunica
