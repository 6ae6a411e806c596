#include "tunica/surface/distance/hausdorff.hpp"

#include "surface/shapes.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

HausdorffResult measure(const TriangleMesh& a, const TriangleMesh& b, double relative_width) {
  HausdorffOptions options;
  options.width = relative_width * diagonal(b);
  options.samples = 2000;
  return hausdorff(a, b, options);
}

// Largest distance from a dense sample of A to B: never above the truth, and below it by at most the sample's reach.
double sampled(const TriangleMesh& a, const TriangleMesh& b, int steps) {
  double largest = 0;
  const ClosestPoint tree(b);
  for (const auto& [i, j, k] : a.triangles) {
    for (int u = 0; u <= steps; ++u) {
      for (int v = 0; u + v <= steps; ++v) {
        const Vec3 p = a.vertices[i] + static_cast<double>(u) / steps * (a.vertices[j] - a.vertices[i]) +
                       static_cast<double>(v) / steps * (a.vertices[k] - a.vertices[i]);
        largest = std::max(largest, tree.closest(p).squared_distance);
      }
    }
  }
  return std::sqrt(largest);
}

void expect_inside(const Interval& interval, double truth) {
  EXPECT_LE(interval.lower, truth);
  EXPECT_GE(interval.upper, truth);
}

TEST(Hausdorff, IdenticalMeshesAreAtZero) {
  for (const TriangleMesh& mesh : {shapes::sphere(3), shapes::torus(30, 20), shapes::soup(50, 1)}) {
    const HausdorffResult result = measure(mesh, mesh, 1e-6);
    EXPECT_EQ(result.both.lower, 0);
    EXPECT_LE(result.both.upper, 1e-6 * diagonal(mesh));
    EXPECT_NEAR(result.mean, 0, 1e-12);
  }
}

TEST(Hausdorff, CoincidentSurfacesWithOtherTriangles) {
  const TriangleMesh sphere = shapes::sphere(2);
  const HausdorffResult split = measure(sphere, shapes::split(shapes::split(sphere)), 1e-6);
  EXPECT_LE(split.both.upper, 1e-6 * diagonal(sphere));
  const HausdorffResult overlaid = measure(shapes::plane(7, 11), shapes::plane(13, 5), 1e-6);
  EXPECT_LE(overlaid.both.upper, 1e-6 * std::sqrt(2.0));
  EXPECT_EQ(overlaid.both.lower, 0);
}

TEST(Hausdorff, OffsetPlanes) {
  const HausdorffResult result = measure(shapes::plane(5, 3), shapes::plane(4, 7, 1, 1, 0.25), 1e-6);
  expect_inside(result.both, 0.25);
  EXPECT_NEAR(result.both.upper, 0.25, 2e-6);
  EXPECT_NEAR(result.mean, 0.25, 1e-9);
  EXPECT_NEAR(result.rms, 0.25, 1e-9);
}

TEST(Hausdorff, PlaneThatReachesFurtherOnOneSide) {
  const HausdorffResult result = measure(shapes::plane(5, 3), shapes::plane(4, 7, 3, 1), 1e-5);
  expect_inside(result.b_to_a, 2);
  EXPECT_LE(result.a_to_b.upper, 1e-4);
  expect_inside(result.both, 2);
  EXPECT_NEAR(result.worst_b.x(), 3, 1e-3);
  EXPECT_NEAR(result.worst_a.x(), 1, 1e-3);
}

TEST(Hausdorff, ConcentricCubesAreTheirCornersApart) {
  // Distance from a corner of the outer cube to the inner one: sqrt(3) times the gap.
  const TriangleMesh cube{
      {{-1, -1, -1}, {1, -1, -1}, {-1, 1, -1}, {1, 1, -1}, {-1, -1, 1}, {1, -1, 1}, {-1, 1, 1}, {1, 1, 1}},
      {{{0, 2, 1},
        {1, 2, 3},
        {4, 5, 6},
        {5, 7, 6},
        {0, 1, 4},
        {1, 5, 4},
        {2, 6, 3},
        {3, 6, 7},
        {0, 4, 2},
        {2, 4, 6},
        {1, 3, 5},
        {3, 7, 5}}}};
  const HausdorffResult result = measure(cube, shapes::moved(cube, Vec3::Zero(), 2), 1e-6);
  expect_inside(result.a_to_b, 1);
  expect_inside(result.b_to_a, std::sqrt(3.0));
  EXPECT_LE(result.both.upper - result.both.lower, 1.1e-6 * 4 * std::sqrt(3.0));
}

TEST(Hausdorff, ConcentricSpheres) {
  // Vertices of both lie on their spheres: the distance is between the gap and the gap plus the sagitta.
  const TriangleMesh inner = shapes::sphere(5, 1);
  const TriangleMesh outer = shapes::sphere(4, 1.5);
  const double sagitta = 1.5 * (1 - std::cos(std::numbers::pi / 4 / 16));
  const HausdorffResult result = measure(outer, inner, 1e-5);
  EXPECT_GE(result.both.upper, 0.5);
  EXPECT_LE(result.both.lower, 0.5 + sagitta);
  EXPECT_LE(result.both.upper - result.both.lower, 1.1e-5 * diagonal(inner));
}

TEST(Hausdorff, SpikeOnOneSideOnly) {
  TriangleMesh spiked = shapes::sphere(4);
  spiked.vertices[0] *= 1.7;
  const HausdorffResult forth = measure(spiked, shapes::sphere(4), 1e-6);
  expect_inside(forth.a_to_b, 0.7);
  EXPECT_LT(forth.b_to_a.upper, 0.2);
  expect_inside(forth.both, 0.7);
  const HausdorffResult back = measure(shapes::sphere(4), spiked, 1e-6);
  expect_inside(back.b_to_a, 0.7);
  EXPECT_EQ(forth.both.lower, back.both.lower);
}

TEST(Hausdorff, MiddleOfASegmentBetweenTwoPoints) {
  // The farthest point of A is inside its edge, where two triangles of B tie: no vertex sees it.
  const TriangleMesh a{{{0, 0, 0}, {10, 0, 0}, {5, 1e-3, 0}}, {{{0, 1, 2}}}};
  const TriangleMesh b{{{0, 0, 0}, {0, 0, -1}, {0, 0, -2}, {10, 0, 0}, {10, 0, -1}, {10, 0, -2}},
                       {{{0, 1, 2}, {3, 4, 5}}}};
  const HausdorffResult result = measure(a, b, 1e-6);
  expect_inside(result.a_to_b, std::sqrt(25 + 1e-6));
  EXPECT_LE(result.a_to_b.upper - result.a_to_b.lower, 1.1e-5);
}

TEST(Hausdorff, CentreOfASphereIsASingleFarthestPoint) {
  // A small triangle through the centre: thousands of triangles of B tie there.
  const TriangleMesh a{{{-0.1, -0.1, 0}, {0.2, -0.1, 0}, {-0.1, 0.2, 0}}, {{{0, 1, 2}}}};
  const TriangleMesh b = shapes::sphere(4);
  const HausdorffResult result = measure(a, b, 1e-5);
  EXPECT_GE(result.a_to_b.upper, ClosestPoint(b).closest(Vec3::Zero()).squared_distance);
  EXPECT_LE(result.a_to_b.upper - result.a_to_b.lower, 1.1e-5 * diagonal(b));
}

TEST(Hausdorff, NeverBelowTheTruthOnTriangleSoup) {
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    const TriangleMesh a = shapes::soup(30, seed);
    const TriangleMesh b = shapes::soup(40, 100 + seed);
    const double reach = 0.3 / 40;  // of a sample in a triangle of at most 0.3
    for (const double width : {0.3, 1e-2, 1e-5}) {
      const HausdorffResult result = measure(a, b, width);
      const double forth = sampled(a, b, 40);
      const double back = sampled(b, a, 40);
      EXPECT_GE(result.a_to_b.upper, forth);
      EXPECT_LE(result.a_to_b.lower, forth + reach);
      EXPECT_GE(result.b_to_a.upper, back);
      EXPECT_LE(result.b_to_a.lower, back + reach);
      EXPECT_LE(result.a_to_b.upper - result.a_to_b.lower, width * diagonal(b) + 1e-7);
      EXPECT_LE(result.b_to_a.upper - result.b_to_a.lower, width * diagonal(b) + 1e-7);
    }
  }
}

TEST(Hausdorff, NeverBelowTheTruthOnCoarseAgainstFine) {
  // Large triangles over many small ones, on rough, folded, open and touching surfaces.
  const TriangleMesh fine = shapes::sphere(4);
  const TriangleMesh strip = shapes::tube(60, 40, 1, 4);
  std::vector<std::pair<TriangleMesh, TriangleMesh>> pairs;
  for (const double roughness : {0.001, 0.01, 0.05, 0.3}) {
    pairs.emplace_back(shapes::sphere(2), shapes::shaken(fine, roughness, 3));
    pairs.emplace_back(shapes::tube(7, 2, 1, 4), shapes::shaken(strip, roughness, 4));
    pairs.emplace_back(shapes::plane(2, 2), shapes::shaken(shapes::plane(40, 40), roughness, 5));
    pairs.emplace_back(shapes::plane(2, 2), shapes::together(shapes::shaken(shapes::plane(40, 40), roughness, 5),
                                                             shapes::shaken(shapes::plane(30, 20), roughness, 6)));
  }
  for (const auto& [a, b] : pairs) {
    const HausdorffResult result = measure(a, b, 1e-6);
    EXPECT_LE(result.both.upper - result.both.lower, 1.1e-6 * diagonal(b));
    EXPECT_GE(result.a_to_b.upper, sampled(a, b, 40));
    EXPECT_GE(result.b_to_a.upper, sampled(b, a, 2));
  }
}

TEST(Hausdorff, TightIntervalsLieInsideWideOnes) {
  const TriangleMesh a = shapes::shaken(shapes::sphere(4), 0.02, 5);
  const TriangleMesh b = shapes::sphere(3);
  const HausdorffResult tight = measure(a, b, 1e-7);
  for (const double width : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
    const HausdorffResult wide = measure(a, b, width);
    EXPECT_LE(wide.both.lower, tight.both.upper);
    EXPECT_GE(wide.both.upper, tight.both.lower);
    EXPECT_LE(wide.both.upper - wide.both.lower, 1.001 * width * diagonal(b));
  }
}

TEST(Hausdorff, DeviationsWidenOutward) {
  HausdorffOptions options;
  options.width = 1e-6;
  options.deviation_a = 0.01;
  options.deviation_b = 0.002;
  const HausdorffResult result = hausdorff(shapes::plane(5, 3), shapes::plane(4, 7, 1, 1, 0.25), options);
  EXPECT_LE(result.both.lower, 0.238);
  EXPECT_GE(result.both.upper, 0.262);
  EXPECT_NEAR(result.both.upper - result.both.lower, 0.024, 1e-5);
}

TEST(Hausdorff, LimitIsDecidedOnTheRightSide) {
  const TriangleMesh a = shapes::shaken(shapes::sphere(4), 0.02, 5);
  const TriangleMesh b = shapes::sphere(4);
  const double truth = measure(a, b, 1e-8).both.upper;
  for (const double factor : {0.2, 0.9, 0.999, 1.001, 1.1, 3.0}) {
    HausdorffOptions options;
    options.width = 1e-7;
    options.samples = 0;
    options.limit = factor * truth;
    const Interval both = hausdorff(a, b, options).both;
    expect_inside(both, truth);
    EXPECT_EQ(both.upper <= *options.limit, factor > 1) << factor;
    EXPECT_EQ(both.lower > *options.limit, factor < 1) << factor;
  }
}

TEST(Hausdorff, ThreadsChangeNothing) {
  const TriangleMesh a = shapes::shaken(shapes::sphere(5), 0.01, 7);
  const TriangleMesh b = shapes::sphere(4);
  const std::size_t before = thread_count();
  set_thread_count(1);
  const HausdorffResult one = measure(a, b, 1e-5);
  set_thread_count(4);
  const HausdorffResult four = measure(a, b, 1e-5);
  set_thread_count(before);
  EXPECT_EQ(one.a_to_b.lower, four.a_to_b.lower);
  EXPECT_EQ(one.a_to_b.upper, four.a_to_b.upper);
  EXPECT_EQ(one.b_to_a.lower, four.b_to_a.lower);
  EXPECT_EQ(one.b_to_a.upper, four.b_to_a.upper);
  EXPECT_EQ(one.mean, four.mean);
  EXPECT_EQ(one.rms, four.rms);
  EXPECT_EQ(one.worst_a, four.worst_a);
}

TEST(Hausdorff, ScaleAndPlaceChangeNothing) {
  const TriangleMesh a = shapes::shaken(shapes::sphere(3), 0.05, 11);
  const TriangleMesh b = shapes::sphere(3);
  const double truth = measure(a, b, 1e-7).both.upper;
  for (const double scale : {1e-6, 1e6}) {
    const Vec3 far = scale * Vec3(1000, -2000, 500);
    const HausdorffResult result = measure(shapes::moved(a, far, scale), shapes::moved(b, far, scale), 1e-6);
    EXPECT_NEAR(result.both.upper / scale, truth, 1e-5);
    EXPECT_LE(result.both.lower / scale, truth + 1e-9);
  }
}

TEST(Hausdorff, MeanOfATiltedPlane) {
  // Distance to z = 0 grows linearly from 0 to h: mean h/2, rms h/sqrt(3).
  TriangleMesh tilted = shapes::plane(3, 2);
  for (Vec3& v : tilted.vertices) {
    v.z() = 0.01 * v.x();
  }
  const HausdorffResult result = measure(tilted, shapes::plane(50, 50, 1, 1), 1e-3);
  EXPECT_NEAR(result.mean, 0.005, 0.005 * 0.01);
  EXPECT_NEAR(result.rms, 0.01 / std::sqrt(3.0), 0.0058 * 0.01);
}

TEST(Hausdorff, WorkIsBounded) {
  HausdorffOptions options;
  options.width = 0;
  options.samples = 0;
  options.max_splits = 5000;
  const Interval both = hausdorff(shapes::shaken(shapes::sphere(3), 0.1, 2), shapes::sphere(4), options).both;
  EXPECT_LT(both.lower, both.upper);
  EXPECT_LT(both.upper, 0.3);
}

}  // namespace
}  // namespace tunica
