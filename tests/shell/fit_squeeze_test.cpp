#include "shell/fit_squeeze.hpp"

#include "shell/fit_cross.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_start.hpp"
#include "shell/fit_states.hpp"
#include "surface/checks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

using testing::collapse_to;
using testing::state_of;
using testing::wavy;

std::size_t slots_in_use(const FitState& state) {
  std::size_t sum = 0;
  std::vector<Index> slots;
  for (Index v = 0; v < state.mesh.positions.size(); ++v) {
    state.mesh.slots_of(v, slots);
    sum += slots.size();
  }
  return sum;
}

TEST(FitSqueeze, FewerShellsAreWithinTheSameLimit) {
  const Target target(wavy(4));
  FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(2));
  const double limit = 0.15;
  collapse_to(state, limit);
  ASSERT_TRUE(regains(samples, state, limit));
  const std::size_t before = state.mesh.alive;
  squeeze(samples, state, limit);
  EXPECT_LT(state.mesh.alive, before);
  EXPECT_LE(state.error(), limit);
  EXPECT_EQ(add_missed(samples, state, limit), 0U);
  EXPECT_EQ(crossing_shells(state.mesh.shell()).size(), 0U);
  EXPECT_EQ(count_thin(state), 0U);
  const MeshFacts facts = examine(flat_facets(state.mesh.shell()));
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_EQ(facts.euler, 2);
}

TEST(FitSqueeze, WhatIsMissedBothWaysRaisesTheErrorsOfItsPatches) {
  const Target target(testing::sphere(4, 10));
  FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  ASSERT_LT(state.error(), 0.3);
  state.mesh.positions[0] *= 1.1;
  FitState one_way = state;
  EXPECT_GT(add_missed(samples, one_way, 0.3), 0U);
  EXPECT_LT(one_way.error(), 0.3);
  const std::size_t before = samples.points().size();
  const std::size_t added = add_missed(samples, state, 0.3, true);
  EXPECT_EQ(samples.points().size(), before + added);
  for (std::size_t t = 0; t < state.patches.size(); ++t) {
    const auto& v = state.mesh.triangles[t];
    const bool pulled = std::find(v.begin(), v.end(), 0U) != v.end();
    EXPECT_TRUE(!pulled || state.patches[t].error > 0.9) << t;
  }
  for (std::size_t i = before; i < samples.points().size(); ++i) {
    EXPECT_LT(target.closest(samples.points()[i].point).distance, 1e-9);
  }
}

TEST(FitSqueeze, MissedPointsJoinTheSamples) {
  TriangleMesh mesh = testing::sphere(4, 10);
  mesh.vertices[1000] *= 1.05;
  const Target target(mesh);
  FitSamples samples(target, 1);
  const std::size_t before = samples.points().size();
  ASSERT_LT(before, 100U);
  FitState state = state_of(samples, testing::sphere(2, 10));
  ASSERT_GT(add_missed(samples, state, 0.3), 0U);
  ASSERT_GT(samples.points().size(), before);
  EXPECT_NEAR((samples.points()[before].point - mesh.vertices[1000]).norm(), 0, 0.6);
  const double unaware = state.error();
  state.attach();
  state.measure();
  EXPECT_GT(state.error(), unaware);
  EXPECT_NEAR(state.error(), 0.5, 0.1);
}

TEST(FitSqueeze, NormalsOfTheirOwnGoWhereTheTargetIsSmooth) {
  const Target target(testing::sphere(4, 10));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  const std::size_t nodes = slots_in_use(state);
  for (Index t = 0; t < state.mesh.triangles.size(); t += 3) {
    for (Index& slot : state.mesh.slots[t]) {
      state.mesh.normals.push_back(state.mesh.normals[slot]);
      slot = static_cast<Index>(state.mesh.normals.size() - 1);
    }
  }
  const std::size_t before = slots_in_use(state);
  ASSERT_GT(before, 2 * nodes);
  EXPECT_EQ(join_normals(state, 0), 0U) << "none is that close";
  EXPECT_EQ(join_normals(state, 0.05), before - nodes);
  EXPECT_EQ(slots_in_use(state), nodes);
  state.attach();
  state.measure();
  EXPECT_LT(state.error(), 0.06);
}

TEST(FitSqueeze, NodesMergeWithinTheLimitOnly) {
  const Target target(testing::sphere(4, 10));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  const auto v = state.mesh.triangles[7];
  EXPECT_FALSE(merge_edge(state, v[0], v[1], 1e-4));
  EXPECT_EQ(state.mesh.alive, 320U);
  EXPECT_TRUE(merge_edge(state, v[0], v[1], 1));
  EXPECT_EQ(state.mesh.alive, 318U);
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(FitSqueeze, AThinTriangleCostsMoreThanAFewShells) {
  const Target target(testing::sphere(4, 10));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  EXPECT_EQ(price(state), 320U);
  const auto v = state.mesh.triangles[7];
  state.mesh.positions[v[0]] = 0.1 * state.mesh.positions[v[0]] + 0.9 * state.mesh.positions[v[1]];
  const std::size_t thin = price(state);
  EXPECT_GT(thin, 330U);
  state.attach();
  state.measure();
  FitSamples more = samples;
  shape_up(more, state, 0.2, 400);
  EXPECT_LT(price(state), thin);
  EXPECT_LE(state.error(), 0.2);
}

}  // namespace
}  // namespace tunica
