// The public functions of lib/surface check what they are given.
#include "damaged.hpp"
#include "surface/shapes.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/decimation/degenerate.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/distance/facing.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/distance/signed_distance.hpp"
#include "tunica/surface/filling/fill.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/seams.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"
#include "tunica/surface/mesh/subdivide.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"
#include "tunica/surface/repair/repair.hpp"

namespace tunica {
namespace {

using namespace arguments;
using Calls = std::vector<Call<TriangleMesh>>;

HausdorffOptions within(double width) {
  HausdorffOptions options;
  options.width = width;
  options.samples = 0;
  return options;
}

DecimateOptions to(std::optional<std::size_t> triangles, std::optional<double> error = {},
                   std::optional<double> angle = {}) {
  DecimateOptions options;
  options.triangles = triangles;
  options.max_error = error;
  options.min_angle = angle;
  return options;
}

/// Functions for which an empty mesh has a meaning.
const Calls of_any{
    {"bounding_box", [](const TriangleMesh& m) { bounding_box(m); }},
    {"diagonal", [](const TriangleMesh& m) { diagonal(m); }},
    {"area", [](const TriangleMesh& m) { area(m); }},
    {"signed_volume", [](const TriangleMesh& m) { signed_volume(m); }},
    {"min_angle_degrees", [](const TriangleMesh& m) { min_angle_degrees(m); }},
    {"mean_quality", [](const TriangleMesh& m) { mean_quality(m); }},
    {"subdivided", [](const TriangleMesh& m) { subdivided(m, 0.2); }},
    {"find_seams", [](const TriangleMesh& m) { find_seams(m); }},
    {"without_seams", [](const TriangleMesh& m) { without_seams(m); }},
    {"find_self_intersections", [](const TriangleMesh& m) { find_self_intersections(m); }},
    {"facing_of", [](const TriangleMesh& m) { facing_of(m); }},
    {"count_degenerate", [](const TriangleMesh& m) { count_degenerate(m); }},
    {"without_degenerate_triangles", [](const TriangleMesh& m) { without_degenerate_triangles(m); }},
    {"BoundaryCurves", [](const TriangleMesh& m) { BoundaryCurves{m}; }},
};

const Calls of_surfaces{
    {"decimate", [](const TriangleMesh& m) { decimate(m, to(4)); }},
    {"decimate to an error", [](const TriangleMesh& m) { decimate(m, to({}, 0.1)); }},
    {"ClosestPoint", [](const TriangleMesh& m) { ClosestPoint{m}; }},
    {"SignedDistance", [](const TriangleMesh& m) { SignedDistance{m}; }},
    {"hausdorff to", [](const TriangleMesh& m) { hausdorff(m, shapes::sphere(1), within(0.1)); }},
    {"hausdorff from", [](const TriangleMesh& m) { hausdorff(shapes::sphere(1), m, within(0.1)); }},
    {"fill", [](const TriangleMesh& m) { fill(m, 0.7); }},
};

TEST(SurfaceArguments, MeshesAreChecked) {
  expect_checked(shapes::sphere(2), of_any);
  expect_checked(shapes::sphere(2), of_surfaces);
}

TEST(SurfaceArguments, WhatNeedsASurfaceRefusesNone) {
  for (const auto& call : of_surfaces) {
    expect_refused(call.name, [&] { call.of({}); });
  }
  for (const auto& call : of_any) {
    EXPECT_NO_THROW(call.of({})) << call.name;
  }
}

TEST(SurfaceArguments, WhatLooksAtAnyMeshRefusesCornersThatDoNotExist) {
  TriangleMesh mesh = shapes::sphere(1);
  mesh.triangles[3][2] = static_cast<Index>(mesh.vertices.size());
  const Incidence around = incidence(shapes::sphere(1));
  expect_refused("examine", [&] { examine(mesh); });
  expect_refused("without_unused", [&] { without_unused(mesh); });
  expect_refused("incidence", [&] { incidence(mesh); });
  expect_refused("neighbours", [&] { neighbours(mesh, around); });
  expect_refused("boundary_loops", [&] { boundary_loops(mesh); });
  expect_refused("repaired", [&] { repaired(mesh); });
  expect_refused("longest_edge", [&] { longest_edge(mesh, 3); });
  expect_refused("longest_edge of none", [&] { longest_edge(mesh, 1'000'000); });
}

TEST(SurfaceArguments, NumbersAreChecked) {
  const TriangleMesh ball = shapes::sphere(2);
  expect_numbers_checked({
      {"max_error", [&](double x) { decimate(ball, to({}, x)); }},
      {"min_angle", [&](double x) { decimate(ball, to(20, {}, x)); }},
      {"width", [&](double x) { hausdorff(ball, ball, within(x)); }},
      {"deviation",
       [&](double x) {
         HausdorffOptions options = within(1);
         options.deviation_b = x;
         hausdorff(ball, ball, options);
       }},
      {"limit",
       [&](double x) {
         HausdorffOptions options = within(1);
         options.limit = x;
         hausdorff(ball, ball, options);
       }},
      {"longest edge", [&](double x) { subdivided(ball, x); }},
      {"size", [&](double x) { fill(ball, x); }},
  });
  const ClosestPoint tree(ball);
  expect_refused("a place", [&] { (void)tree.closest(Vec3(0, nan, 0)); });
  expect_refused("a place far off", [&] { (void)tree.closest(Vec3(infinity, 0, 0)); });
  expect_refused("a guess", [&] { (void)tree.closest(Vec3(0, 0, 0), 1'000'000); });
  expect_refused("spikes", [&] { without_degenerate_triangles(ball, nan); });
}

TEST(SurfaceArguments, TetrahedraAreChecked) {
  const TetMesh good{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1, 2, 3}}};
  EXPECT_NO_THROW(boundary_triangles(good));
  TetMesh index = good, place = good;
  index.tetrahedra[0][3] = 4;
  place.vertices[2].x() = nan;
  for (const TetMesh& bad : {index, place}) {
    expect_refused("boundary_triangles", [&] { boundary_triangles(bad); });
    expect_refused("smallest_dihedral", [&] { smallest_dihedral(bad); });
  }
}

}  // namespace
}  // namespace tunica
