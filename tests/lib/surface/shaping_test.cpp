#include "tunica/surface/decimation/detail/shaping.hpp"

#include "surface/decimated.hpp"
#include "surface/shapes.hpp"
#include "tunica/surface/decimation/detail/shape_patch.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

void expect_same_topology(const TriangleMesh& before, const TriangleMesh& after) {
  const MeshFacts was = examine(before);
  const MeshFacts is = examine(after);
  EXPECT_TRUE(is.manifold && is.oriented);
  EXPECT_EQ(is.euler, was.euler);
  EXPECT_EQ(is.components, was.components);
  EXPECT_EQ(is.boundary_loops, was.boundary_loops);
  EXPECT_EQ(is.degenerate_triangles, 0U);
}

TEST(Shaping, GoodTrianglesForALittleErrorOnSmoothSurfaces) {
  const TriangleMesh waves = [] {
    TriangleMesh mesh = shapes::sphere(4, 10);
    for (Vec3& v : mesh.vertices) {
      v *= 1 + 0.08 * std::sin(0.6 * v.x()) * std::cos(0.5 * v.y() + 0.4 * v.z());
    }
    return mesh;
  }();
  for (const TriangleMesh& mesh : {shapes::sphere(4), shapes::torus(80, 40), shapes::tube(60, 40), waves}) {
    for (const std::size_t count : {std::size_t{900}, std::size_t{250}}) {
      const DecimateResult good = decimated_to(mesh, count, 20);
      EXPECT_TRUE(good.angle_held && good.count_reached);
      EXPECT_LE(good.mesh.triangles.size(), count);
      EXPECT_GE(good.mesh.triangles.size() + 4, count);
      EXPECT_GE(min_angle_degrees(good.mesh), 20);
      EXPECT_GE(mean_quality(good.mesh), 0.85);
      const double error = distance(good.mesh, mesh);
      if (examine(mesh).closed) {
        EXPECT_LE(error, 2.5 * distance(decimated_to(mesh, count).mesh, mesh));
      } else {
        // On a straight tube needles cost nothing: what counts is what good triangles can do. Of edge h, h^2 / 8 off.
        const double squared_edge = area(mesh) / static_cast<double>(count) * 4 / std::sqrt(3.0);
        EXPECT_LE(error, 1.5 * squared_edge / 8);
      }
      expect_same_topology(mesh, good.mesh);
    }
  }
}

TEST(Shaping, RoughSurfacesKeepTheirTopologyAndFaceOutward) {
  for (const std::uint32_t seed : {1U, 2U}) {
    const TriangleMesh mesh = shapes::shaken(shapes::sphere(5), 0.01, seed);
    const DecimateResult good = decimated_to(mesh, 800, 20);
    EXPECT_TRUE(good.angle_held);
    expect_same_topology(mesh, good.mesh);
    EXPECT_LE(distance(good.mesh, mesh), 2.0 * distance(decimated_to(mesh, 800).mesh, mesh));
    for (const auto& [i, j, k] : good.mesh.triangles) {
      const Vec3& a = good.mesh.vertices[i];
      const Vec3 normal = (good.mesh.vertices[j] - a).cross(good.mesh.vertices[k] - a);
      EXPECT_GT(normal.dot(a + good.mesh.vertices[j] + good.mesh.vertices[k]), 0);
    }
  }
}

TEST(Shaping, BoundaryVerticesStayOnTheBoundaryCurve) {
  const TriangleMesh tube = shapes::tube(64, 40);
  const DecimateResult good = decimated_to(tube, 300, 20);
  for (const auto& loop : boundary_loops(good.mesh)) {
    EXPECT_GE(loop.size(), 3U);
    for (const Index v : loop) {
      const Vec3& p = good.mesh.vertices[v];
      EXPECT_TRUE(std::abs(p.z()) < 1e-12 || std::abs(p.z() - 4) < 1e-12);
      const double radius = std::hypot(p.x(), p.y());
      EXPECT_LE(radius, 1 + 1e-12);
      EXPECT_GE(radius, std::cos(std::numbers::pi / 64) - 1e-12);
    }
  }
}

/// An open vessel along an arch, wide at one end and narrow at the other, its section uneven.
TriangleMesh arch() {
  TriangleMesh mesh = shapes::tube(72, 140, 1, 1);
  for (Vec3& p : mesh.vertices) {
    const double s = p.z();
    const double bend = std::numbers::pi * s;
    const double phi = std::atan2(p.y(), p.x());
    const double radius = (14 - 6 * s + 3 * std::exp(-std::pow((s - 0.75) / 0.06, 2))) *
                          (1 + 0.05 * std::cos(3 * phi + 6 * s) + 0.03 * std::sin(5 * phi - 9 * s));
    const Vec3 outward(-std::cos(bend), 0, std::sin(bend));
    p = 60 * outward + radius * (std::cos(phi) * outward + std::sin(phi) * Vec3(0, 1, 0));
  }
  return mesh;
}

TEST(Shaping, RimsKeepEnoughEdgesForTheError) {
  const TriangleMesh vessel = arch();
  const auto largest_edge_error = [&](const TriangleMesh& mesh) {
    double most = 0;
    const BoundaryCurves curves(vessel);
    for (const auto& loop : boundary_loops(mesh)) {
      std::vector<Vec3> points;
      for (const Index v : loop) {
        points.push_back(mesh.vertices[v]);
      }
      const Index curve = curves.curve_of(points);
      for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec3 middle = 0.5 * (points[i] + points[(i + 1) % points.size()]);
        most = std::max(most, (middle - curves.point(curves.nearest(middle, curve))).norm());
      }
    }
    return most;
  };
  double before = std::numeric_limits<double>::infinity();
  for (const std::size_t count : {std::size_t{300}, std::size_t{560}, std::size_t{1120}}) {
    const DecimateResult good = decimated_to(vessel, count, 20);
    EXPECT_TRUE(good.angle_held);
    const double error = distance(good.mesh, vessel);
    // No rim is worse than the rest can be, and twice the triangles are closer.
    EXPECT_LT(largest_edge_error(good.mesh), 3 * distance(decimated_to(vessel, count).mesh, vessel));
    EXPECT_LT(error, 0.8 * before);
    before = error;
  }
}

TEST(Shaping, TheFewestTrianglesForAnErrorAreNotFarFromWhatACountHolds) {
  const TriangleMesh vessel = arch();
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 1.02 * distance(decimated_to(vessel, 300, 20).mesh, vessel);
  const DecimateResult result = decimate(vessel, options);
  EXPECT_TRUE(result.error_kept && result.angle_held);
  EXPECT_LE(result.mesh.triangles.size(), 330U);
}

TEST(Shaping, TheCountHoldsAtBoundariesToo) {
  // Collapses at a rim take one triangle away, splits inside add two.
  const TriangleMesh sheet = shapes::shaken(shapes::plane(40, 40), 0.004, 9);
  for (std::size_t count = 95; count < 101; ++count) {
    EXPECT_LE(decimated_to(sheet, count, 20).mesh.triangles.size(), count);
  }
}

TEST(Shaping, EdgesOfABoxStaySharp) {
  // The cube's creases are between its faces: none of its corners may be cut.
  TriangleMesh cube;
  for (const int axis : {0, 1, 2}) {
    for (const double side : {0.0, 1.0}) {
      TriangleMesh face = shapes::plane(12, 12);
      for (Vec3& v : face.vertices) {
        const Vec3 p = v;
        v[axis] = side;
        v[(axis + 1) % 3] = p.x();
        v[(axis + 2) % 3] = p.y();
      }
      for (auto& t : face.triangles) {
        if (side == 0) {
          std::swap(t[1], t[2]);
        }
      }
      cube = shapes::together(cube, face);
    }
  }
  TriangleMesh welded;
  std::map<std::array<long, 3>, Index> seen;
  for (auto t : cube.triangles) {
    for (Index& v : t) {
      const Vec3& p = cube.vertices[v];
      const std::array<long, 3> key{std::lround(24 * p.x()), std::lround(24 * p.y()), std::lround(24 * p.z())};
      const auto [it, is_new] = seen.try_emplace(key, static_cast<Index>(welded.vertices.size()));
      if (is_new) {
        welded.vertices.push_back(p);
      }
      v = it->second;
    }
    welded.triangles.push_back(t);
  }
  ASSERT_TRUE(examine(welded).closed);
  const DecimateResult good = decimated_to(welded, 200, 20);
  EXPECT_TRUE(good.angle_held);
  EXPECT_LT(distance(good.mesh, welded), 0.03);
  EXPECT_GE(mean_quality(good.mesh), 0.8);
}

TEST(Shaping, AngleAndErrorTogether) {
  const TriangleMesh mesh = shapes::torus(60, 30);
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 0.01 * diagonal(mesh);
  const DecimateResult result = decimate(mesh, options);
  ASSERT_TRUE(result.error_kept && result.angle_held);
  EXPECT_LE(result.error->upper, *options.max_error);
  EXPECT_LE(distance(result.mesh, mesh), *options.max_error + 1.1e-5 * diagonal(mesh));
  EXPECT_GE(min_angle_degrees(result.mesh), 20);
  EXPECT_LT(result.mesh.triangles.size(), mesh.triangles.size() / 6);
}

/// A wavy sheet of squares of 1 mm with triangles on its rim at y = 0 that stick out 5 mm, 11 degrees sharp.
TriangleMesh sheet_with_tips(std::size_t squares, const std::vector<Index>& tips) {
  const auto side = static_cast<double>(squares);
  TriangleMesh mesh = shapes::plane(squares, squares, side, side);
  for (Vec3& v : mesh.vertices) {
    v.z() = 1.5 * std::sin(0.2 * v.x()) * std::cos(0.2 * v.y());
  }
  for (const Index i : tips) {
    mesh.vertices.emplace_back(0.5 * (mesh.vertices[i] + mesh.vertices[i + 1]) - Vec3(0, 5, 0));
    mesh.triangles.push_back({i + 1, i, static_cast<Index>(mesh.vertices.size() - 1)});
  }
  return mesh;
}

TEST(Shaping, SharpCornersOfTheBoundaryAreNotWidened) {
  const TriangleMesh mesh = sheet_with_tips(40, {6, 20, 34});
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 0.2;
  const DecimateResult result = decimate(mesh, options);
  EXPECT_TRUE(result.error_kept && result.angle_held);
  EXPECT_GE(result.smallest_angle, 20);
  EXPECT_LE(distance(result.mesh, mesh), 0.2 + 1.1e-5 * diagonal(mesh));
  // About 130 do without tips, and the rim beside each of them has to be finer. Widened tips leave no fewer than 3,000.
  EXPECT_LE(result.mesh.triangles.size(), 400U);
  for (std::size_t i = 1; i <= 3; ++i) {
    EXPECT_EQ(
        std::count(result.mesh.vertices.begin(), result.mesh.vertices.end(), mesh.vertices[mesh.vertices.size() - i]),
        1);
  }
  expect_same_topology(mesh, result.mesh);
}

TEST(Shaping, SharpCornersOfCreasesAreNotWidened) {
  // A pyramid of 4 by 4 and 20 high: its sides meet in corners of 11 degrees.
  TriangleMesh pyramid{{{-2, -2, 0}, {2, -2, 0}, {2, 2, 0}, {-2, 2, 0}, {0, 0, 20}, {0, 0, 0}},
                       {{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {1, 0, 5}, {2, 1, 5}, {3, 2, 5}, {0, 3, 5}}}};
  for (int i = 0; i < 4; ++i) {
    pyramid = shapes::split(pyramid);
  }
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 0.1;
  const DecimateResult result = decimate(pyramid, options);
  EXPECT_TRUE(result.error_kept && result.angle_held);
  EXPECT_LE(result.mesh.triangles.size(), 70U);
  EXPECT_EQ(std::count(result.mesh.vertices.begin(), result.mesh.vertices.end(), Vec3(0, 0, 20)), 1);
  expect_same_topology(pyramid, result.mesh);
}

TEST(Shaping, PinnedVerticesStay) {
  const TriangleMesh sheet = shapes::plane(4, 4);
  const ClosestPoint tree(sheet);
  const BoundaryCurves curves(sheet);
  const NearestPoint nearest = [&tree](const Vec3& p, Index near, double) { return tree.closest(p, near); };
  ShapedMesh state(sheet, sheet, nearest, sample_target(sheet, sheet, tree), curves);
  state.measure_all();
  const Index inner = 6, neighbour = 7, rim = 1;  // (1/4, 1/4), (1/2, 1/4) and (1/4, 0)
  const Vec3 place(0.3, 0.05, 0);
  ASSERT_FALSE(state.pin(inner, {0.3, -0.1, 0}, 0));  // that would fold
  EXPECT_FALSE(state.is_pinned(inner));
  ASSERT_TRUE(state.pin(inner, place, 0));
  EXPECT_EQ(state.mesh().positions[inner], place);
  PatchTrial trial;
  state.make_move(inner, {0.25, 0.25, 0}, trial);
  EXPECT_EQ(state.evaluate(trial, 1e300), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(state.make_collapse(inner, rim, trial));
  EXPECT_FALSE(state.make_collapse(rim, inner, trial));
  for (const auto& [u, v] : {std::pair(inner, neighbour), std::pair(neighbour, inner)}) {
    ASSERT_TRUE(state.make_collapse(u, v, trial));
    EXPECT_EQ(trial.moved, inner);
    EXPECT_EQ(trial.position, place);
  }
  // The triangle below it is flat there; what it has beside the rim is charged for, and below its least angle all of
  // it.
  for (const double least : {0.0, 90.0}) {
    ASSERT_TRUE(state.pin(inner, place, least));
    for (const Index t : state.mesh().around[inner]) {
      const auto& c = state.mesh().triangles[t];
      double smallest = 180;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& at = state.mesh().positions;
        const double angle = angle_degrees(at[c[k]], at[c[(k + 1) % 3]], at[c[(k + 2) % 3]]);
        if (c[k] != inner || angle < least) {
          smallest = std::min(smallest, angle);
        }
      }
      EXPECT_DOUBLE_EQ(state.smallest_angle(t), smallest);
    }
  }
}

TEST(Shaping, CornersOfTeethTooSmallForTheResultAreNoExcuse) {
  // A rim of teeth, 17 degrees sharp, a third as wide as the result's edges are long. All else is flat: the few
  // triangles at the rim have all of the error.
  TriangleMesh sheet = shapes::plane(160, 40);
  for (Index i = 1; i < 160; i += 2) {
    sheet.vertices[i].y() -= 0.04;
  }
  for (const std::size_t count : {100, 120, 160}) {
    const DecimateResult result = decimated_to(sheet, count, 20);
    EXPECT_TRUE(result.angle_held);
    EXPECT_GE(min_angle_degrees(result.mesh), 20);
    EXPECT_LE(distance(result.mesh, sheet), 0.06);
  }
}

TEST(Shaping, AMeshThatHoldsTheAngleIsTheLastResortForAnError) {
  const TriangleMesh mesh = sheet_with_tips(10, {5});
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 1e-6;
  const DecimateResult result = decimate(mesh, options);
  EXPECT_TRUE(result.error_kept && result.angle_held);
  EXPECT_EQ(result.mesh.triangles.size(), mesh.triangles.size());
}

TEST(Shaping, WhereTheAngleIsOutOfReachTheBestWithinTheErrorComesBack) {
  // A lens whose rim is thinner than any triangle that the error allows.
  TriangleMesh lens = shapes::sphere(3);
  for (Vec3& p : lens.vertices) {
    p.z() *= 0.025;
  }
  DecimateOptions options;
  options.min_angle = 20;
  options.max_error = 0.01 * diagonal(lens);
  const DecimateResult result = decimate(lens, options);
  EXPECT_FALSE(result.angle_held);
  EXPECT_TRUE(result.error_kept);
  EXPECT_GT(result.smallest_angle, 0.3);
}

TEST(Shaping, AnAngleThatCannotBeHeldIsSaid) {
  // So few triangles cannot fill a narrow strip well, and do not leave a part of it for the sake of their shape.
  for (const double width : {0.02, 0.05}) {
    const TriangleMesh strip = shapes::plane(40, 2, 1, width);
    for (const std::size_t count : {2, 4, 8}) {
      const DecimateResult result = decimated_to(strip, count, 20);
      EXPECT_LT(result.smallest_angle, 20);
      EXPECT_FALSE(result.angle_held);
      EXPECT_LT(distance(result.mesh, strip), 0.5 * std::sqrt(width / static_cast<double>(count)));
    }
  }
}

TEST(Shaping, CornersSharperThanAskedForAreExempt) {
  // A wedge of 10 degrees as one fan: the tip cannot be better, the other angles are what they are.
  const double tip = 10 * std::numbers::pi / 180;
  const TriangleMesh wedge{{{0, 0, 0}, {1, 0, 0}, {std::cos(tip), std::sin(tip), 0}}, {{{0, 1, 2}}}};
  EXPECT_EQ(smallest_free_angle(wedge, sharp_corners(wedge, 20), 20), 60);
  // The same triangle within a plane has no such excuse.
  EXPECT_NEAR(smallest_free_angle(wedge, sharp_corners(shapes::plane(4, 4), 20), 20), 10, 1e-9);
  // Nor has one that is much narrower than the corner.
  TriangleMesh sliver = wedge;
  sliver.vertices[2] = {std::cos(tip / 3), std::sin(tip / 3), 0};
  EXPECT_NEAR(smallest_free_angle(sliver, sharp_corners(wedge, 20), 20), 10.0 / 3, 1e-9);
}

TEST(Shaping, TheSameMeshEveryTime) {
  const TriangleMesh mesh = shapes::shaken(shapes::torus(60, 30), 0.01, 5);
  const TriangleMesh one = decimated_to(mesh, 500, 20).mesh;
  const TriangleMesh other = decimated_to(mesh, 500, 20).mesh;
  EXPECT_EQ(one.triangles, other.triangles);
  EXPECT_TRUE(std::equal(one.vertices.begin(), one.vertices.end(), other.vertices.begin(), other.vertices.end()));
}

}  // namespace
}  // namespace tunica
