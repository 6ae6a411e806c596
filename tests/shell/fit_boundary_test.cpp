// Boundaries as curves: what the samples, pieces and looks of the fit know of them.
#include "shell/fit_missed.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_states.hpp"
#include "surface/incidence.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using testing::cylinder;
using testing::state_of;

std::size_t boundary_residuals(const FitState& state, double above) {
  std::size_t count = 0;
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    std::vector<Residual> found;
    state.samples().from_boundary(state.mesh.patch(t), Vec3::UnitX(), state.mesh.boundary_edges(t), found);
    count += static_cast<std::size_t>(
        std::count_if(found.begin(), found.end(), [&](const Residual& r) { return r.distance > above; }));
  }
  return count;
}

TEST(FitBoundary, PointsOfTheBoundaryBelongToBoundaryEdges) {
  const Target target(cylinder(60, 40, 10, 40));
  const FitSamples samples(target, 80);
  ASSERT_TRUE(samples.has_boundaries());
  FitState state = state_of(samples, cylinder(8, 5, 10, 40));
  EXPECT_EQ(state.mesh.boundary().size(), 16U);
  for (int again = 0; again < 2; ++again) {
    std::size_t of_boundary = 0;
    for (Index t = 0; t < state.patches.size(); ++t) {
      for (const Index q : state.patches[t].attached) {
        if (samples.points()[q].of_boundary) {
          ++of_boundary;
          EXPECT_NE(state.mesh.boundary_edges(t), 0);
        }
      }
    }
    EXPECT_EQ(of_boundary, 120U);
    state.attach_again();
  }
}

TEST(FitBoundary, ABoundaryThatEndsTooSoonIsAnErrorThoughTheSurfacesAreCloser) {
  // Nodes of the upper end drawn inwards by 1.5 along the surface: the target beyond is 1.5 from the shells, and so are
  // the shells' edges from the target's, which the grid of their own points cannot see.
  const Target target(cylinder(60, 40, 10, 40));
  const FitSamples samples(target, 80);
  TriangleMesh coarse = cylinder(8, 5, 10, 40);
  for (Vec3& p : coarse.vertices) {
    p.z() = p.z() > 39 ? 38.5 : p.z();
  }
  const FitState state = state_of(samples, coarse);
  EXPECT_NEAR(state.error(), 1.5, 0.1);
  EXPECT_EQ(boundary_residuals(state, 1.4), 8U * 5U);
  const FitSamples regardless(target, 80, false);
  EXPECT_FALSE(regardless.has_boundaries());
  EXPECT_TRUE(regardless.further_boundary_points().empty());
  EXPECT_EQ(boundary_residuals(state_of(regardless, coarse), 0), 0U);
}

TEST(FitBoundary, StepsOfAllNodesBringItBack) {
  const Target target(cylinder(60, 40, 10, 40));
  const FitSamples samples(target, 80);
  TriangleMesh coarse = cylinder(8, 5, 10, 40);
  for (Vec3& p : coarse.vertices) {
    p.z() = p.z() > 39 ? 38.5 : p.z();
  }
  FitState state = state_of(samples, coarse);
  for (int i = 0; i < 6; ++i) {
    state.solve(i < 2 ? 2 : 8, 1);
    state.attach_again();
    state.measure();
  }
  EXPECT_LT(state.error(), 0.1);
  EXPECT_EQ(boundary_residuals(state, 0.1), 0U);
}

TEST(FitBoundary, TheRimOfAPieceIsNoBoundary) {
  const Target target(cylinder(60, 40, 10, 40));
  const FitSamples samples(target, 80);
  const FitState state = state_of(samples, cylinder(8, 2, 10, 40));
  // With two rows of triangles there are edges across that join boundary nodes of both sides of a piece.
  for (Index v = 0; v < state.mesh.positions.size(); ++v) {
    const FitRegion region = cut_out(state, {v}, 1);
    for (std::size_t i = 0; i < region.triangles.size(); ++i) {
      EXPECT_EQ(region.state.mesh.boundary_edges(static_cast<Index>(i)),
                state.mesh.boundary_edges(region.triangles[i]));
    }
    EXPECT_LT(region.state.mesh.boundary().size(), 16U);
  }
}

TEST(FitBoundary, WhatSamplesMissedOfItJoinsThem) {
  // One spit of the target's boundary, narrower than the few samples see.
  TriangleMesh mesh = cylinder(60, 40, 10, 40);
  mesh.vertices[60 * 40 + 7].z() = 43;
  const Target target(mesh);
  FitSamples samples(target, 1);
  FitState state = state_of(samples, cylinder(12, 6, 10, 40));
  const std::size_t before = samples.points().size();
  EXPECT_GT(add_missed(samples, state, 0.6), 0U);
  std::size_t of_boundary = 0;
  for (std::size_t i = before; i < samples.points().size(); ++i) {
    of_boundary += samples.points()[i].of_boundary ? 1 : 0;
  }
  EXPECT_GT(of_boundary, 0U);
  std::vector<SamplePoint> farthest;
  const Vec3 tip = mesh.vertices[60 * 40 + 7];
  EXPECT_FALSE(holds_within(state, {tip - Vec3::Constant(5), tip + Vec3::Constant(5)}, 1, farthest));
  ASSERT_FALSE(farthest.empty());
  EXPECT_TRUE(farthest.back().of_boundary);
}

TEST(Target, LeavesVerticesOfNoTriangleOut) {
  TriangleMesh mesh = cylinder(12, 4, 10, 40);
  const std::size_t count = mesh.vertices.size();
  mesh.vertices.insert(mesh.vertices.begin() + 5, Vec3(500, 0, 0));
  for (auto& corners : mesh.triangles) {
    for (Index& v : corners) {
      v += v >= 5 ? 1 : 0;
    }
  }
  const Target target(mesh);
  EXPECT_EQ(target.mesh().vertices.size(), count);
  EXPECT_EQ(target.mesh().triangles, cylinder(12, 4, 10, 40).triangles);
  const FitSamples samples(target, 1000);
  for (const SamplePoint& p : samples.points()) {
    EXPECT_LT(p.point.x(), 11);
  }
}

}  // namespace
}  // namespace tunica
