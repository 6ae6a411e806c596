#include "shell/fit_minimax.hpp"

#include "shell/fit_polish.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_states.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

using testing::collapse_to;
using testing::state_of;
using testing::wavy;

/// A square sheet of 2 n^2 triangles, 40 mm wide, with a spike in the middle.
TriangleMesh sheet(Index n, double spike) {
  TriangleMesh mesh;
  for (Index j = 0; j <= n; ++j) {
    for (Index i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(40.0 * i / n, 40.0 * j / n, 2 * i == n && 2 * j == n ? spike : 0);
    }
  }
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      const Index a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

TEST(FitMinimax, ASpikeIsMetHalfWay) {
  // No patch is narrow enough to follow it: least squares passes by below, and the least largest error is half of it.
  const double spike = 1;
  const Target target(sheet(60, spike));
  FitSamples samples(target, 32);
  samples.add({Vec3(20, 20, spike)});
  FitState state = state_of(samples, sheet(4, 0));
  state.solve(2, 1);
  state.attach();
  state.measure();
  ASSERT_GT(state.error(), 0.8 * spike);
  const double left = lessen_largest(state, 0, 20);
  EXPECT_LT(left, 0.55 * spike);
  EXPECT_GT(left, 0.2 * spike);
}

TEST(FitMinimax, LargestErrorsGetLessThanLeastSquaresLeaveThem) {
  const Target target(wavy(5));
  for (const double limit : {0.05, 0.15, 0.4}) {
    const FitSamples samples(target, 160);
    FitState state = state_of(samples, wavy(3));
    collapse_to(state, limit);
    settle(state, 20);
    const double before = state.error();
    const double left = lessen_largest(state, 0, 12);
    EXPECT_LT(left, 0.9 * before) << limit;
    EXPECT_EQ(left, state.error());
    state.attach();  // by a tessellation: some points go to a patch that is not quite the closest
    state.measure();
    EXPECT_LT(state.error(), 1.1 * left) << limit;
    EXPECT_EQ(count_thin(state), 0U) << limit;
  }
}

TEST(FitMinimax, WhatIsHeldStaysAndWhatIsNotPromisingIsLeft) {
  const Target target(wavy(5));
  const FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(3));
  collapse_to(state, 0.15);
  FitRegion region = cut_out(state, {0}, 2);
  region.state.measure();
  const FitState before = region.state;
  EXPECT_EQ(lessen_largest(region.state, 2 * before.error(), 10), before.error()) << "enough already";
  EXPECT_EQ(lessen_largest(region.state, 0, 10, 0.01 * before.error()), before.error()) << "out of reach";
  EXPECT_EQ(region.state.mesh.positions, before.mesh.positions);
  EXPECT_LT(lessen_largest(region.state, 0, 10), before.error());
  std::size_t moved = 0;
  for (Index v = 0; v < before.mesh.positions.size(); ++v) {
    const bool same = region.state.mesh.positions[v] == before.mesh.positions[v];
    EXPECT_TRUE(same || !before.mesh.is_held(v)) << v;
    moved += same ? 0 : 1;
  }
  EXPECT_GT(moved, 0U);
}

TEST(FitMinimax, WatertightPatchesWithCreasesToo) {
  TriangleMesh mesh = sheet(20, 0), coarse = sheet(4, 0);
  for (TriangleMesh* each : {&mesh, &coarse}) {
    for (Vec3& p : each->vertices) {  // a roof of two arches
      const double x = std::abs(p.x() - 20);
      p.z() = 8 - 0.4 * x + 0.002 * x * x * x - 0.004 * (p.y() - 20) * (p.y() - 20);
    }
  }
  const Target target(mesh);
  const FitSamples samples(target, 32);
  FitStart start;
  start.mesh = coarse;
  FitMesh shells = prepare_fit(start, target);
  shells.kind = Patch::watertight;
  FitState state(samples, std::move(shells), {});
  state.attach();
  state.measure();
  for (int i = 0; i < 4; ++i) {
    state.solve(2, 1);
    state.attach();
    state.measure();
  }
  const double before = state.error();
  ASSERT_GT(before, 1e-4);
  EXPECT_LT(lessen_largest(state, 0, 12), 0.8 * before);
}

}  // namespace
}  // namespace tunica
