// CGAL's bounded-error Hausdorff distance as an oracle: another implementation, on exact predicates.
#include "bench/cgal_mesh.hpp"
#include "surface/shapes.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/distance.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace tunica {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;

TEST(Hausdorff, AgreesWithCgalsBoundedError) {
  const std::vector<std::pair<TriangleMesh, TriangleMesh>> pairs{
      {shapes::shaken(shapes::sphere(2), 0.02, 7), shapes::sphere(3)},
      {shapes::shaken(shapes::sphere(3), 0.05, 7), shapes::shaken(shapes::sphere(2), 0.1, 7)},
      {shapes::torus(24, 12), shapes::shaken(shapes::torus(30, 20), 0.03, 7)},
      {shapes::shaken(shapes::plane(7, 11), 0.02, 7), shapes::plane(13, 5, 1, 1, 0.1)}};
  for (const auto& [a, b] : pairs) {
    const double error = 1e-4 * diagonal(b);
    const CgalMesh cgal_a = to_cgal<CgalMesh>(a), cgal_b = to_cgal<CgalMesh>(b);
    namespace pmp = CGAL::Polygon_mesh_processing;
    const double there = pmp::bounded_error_Hausdorff_distance<CGAL::Sequential_tag>(cgal_a, cgal_b, error);
    const double back = pmp::bounded_error_Hausdorff_distance<CGAL::Sequential_tag>(cgal_b, cgal_a, error);
    HausdorffOptions options;
    options.width = 1e-6 * diagonal(b);
    options.samples = 0;
    const HausdorffResult found = hausdorff(a, b, options);
    for (const auto& [own, other] :
         {std::pair(found.a_to_b, there), {found.b_to_a, back}, {found.both, std::max(there, back)}}) {
      EXPECT_LE(own.lower, other + error);
      EXPECT_GE(own.upper, other - error);
      EXPECT_LE(own.upper - own.lower, 1.01 * options.width);
    }
  }
}

}  // namespace
}  // namespace tunica
