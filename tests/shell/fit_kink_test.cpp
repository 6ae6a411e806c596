// Normals that part where shells meet: how far they may, where they may not, and what that saves.
#include "shell/fit_cross.hpp"
#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_exchange.hpp"
#include "shell/fit_missed.hpp"
#include "shell/fit_region.hpp"
#include "shell/fit_shape.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_states.hpp"
#include "shell/fit_trial.hpp"
#include "surface/checks.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunica {
namespace {

using testing::angle_between;
using testing::collapse_to;
using testing::largest_kink;
using testing::state_of;
using testing::wavy;

constexpr double degree = 3.14159265358979323846 / 180;

/// Two squares of edge 10 that meet at a right angle, n x n squares each.
TriangleMesh roof(int n) {
  TriangleMesh mesh;
  for (int j = -n; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      mesh.vertices.emplace_back(10.0 * i / n, 10.0 * std::min(j, 0) / n, -10.0 * std::max(j, 0) / n);
    }
  }
  const auto at = [&](int j, int i) { return static_cast<Index>(j * (n + 1) + i); };
  for (int j = 0; j < 2 * n; ++j) {
    for (int i = 0; i < n; ++i) {
      mesh.triangles.push_back({at(j, i), at(j, i + 1), at(j + 1, i + 1)});
      mesh.triangles.push_back({at(j, i), at(j + 1, i + 1), at(j + 1, i)});
    }
  }
  return mesh;
}

/// Whether all of a state is certainly within `tolerance` of the target.
bool holds(const FitState& state, double tolerance) {
  const Vec3 everywhere = Vec3::Constant(std::numeric_limits<double>::infinity());
  std::vector<SamplePoint> farthest;
  return holds_within(state, {-everywhere, everywhere}, tolerance, farthest);
}

TEST(FitKink, NormalsOfOneSectorAreHeldTogetherAboutTheirMean) {
  const auto tilted = [](double degrees) { return Vec3(std::sin(degrees * degree), 0, std::cos(degrees * degree)); };
  std::vector<Vec3> normals{tilted(-40), tilted(40), Vec3(0, 1, 0), tilted(0), tilted(0.5)};
  const std::vector<Index> sectors{0, 0, 1, 0, 2};
  hold_together(normals, sectors, 30);
  EXPECT_NEAR(angle_between(normals[0], normals[1]), 30, 1e-9);
  EXPECT_NEAR(angle_between(normals[0], tilted(-15)), 0, 1e-6);
  EXPECT_NEAR(angle_between(normals[3], tilted(0)), 0, 1e-6);
  EXPECT_EQ(normals[2], Vec3(0, 1, 0));
  EXPECT_EQ(normals[4], tilted(0.5));
  const std::vector<Vec3> before = normals;
  hold_together(normals, sectors, 31);
  EXPECT_EQ(normals, before) << "what is close enough stays";
  hold_together(normals, sectors, 0);
  EXPECT_NEAR(angle_between(normals[0], normals[1]), 0, 1e-6);
  EXPECT_NEAR(angle_between(normals[0], normals[3]), 0, 1e-6);
}

TEST(FitKink, AtASharpRimEverySideStartsFromANormalThatSuitsIt) {
  // One facet above and one below the rim of a thin disc: no normal agrees with both.
  Trial rim;
  for (const double side : {1.0, -1.0}) {
    PlacedPatch patch;
    patch.corner = 0;
    patch.slot = rim.patches.size();
    patch.shape.corners = {Vec3::Zero(), Vec3(-1, side, 0.2 * side), Vec3(-1, -side, 0.2 * side)};
    rim.patches.push_back(patch);
  }
  const Vec3 outward(1, 0, 0);
  rim.node.normals = {outward, outward};
  rim.node.sectors = {0, 0};
  const auto agreement = [&](const Trial& trial, std::size_t slot) {
    return trial.node.normals[slot].dot(facing_of(trial.patches[slot].shape.corners));
  };
  Trial shared = rim;
  make_compatible(shared);
  EXPECT_EQ(shared.node.normals, rim.node.normals) << "nothing suits";
  Trial parted = rim;
  parted.limits.kink = 75;
  make_compatible(parted);
  hold_together(parted.node.normals, parted.node.sectors, parted.limits.kink);
  EXPECT_LT(agreement(rim, 0), 0.2);
  EXPECT_NEAR(angle_between(parted.node.normals[0], parted.node.normals[1]), 75, 1e-9);
  EXPECT_GT(agreement(parted, 0), 0.7);
  EXPECT_GT(agreement(parted, 1), 0.7);
  // At a crease each sector has normals of its own.
  Trial creased = rim;
  creased.node.sectors = {0, 1};
  creased.node.normals[1] = facing_of(rim.patches[1].shape.corners);
  make_compatible(creased);
  EXPECT_GE(agreement(creased, 0), creased.limits.agreement);
  EXPECT_EQ(creased.node.normals[1], facing_of(rim.patches[1].shape.corners));
}

TEST(FitKink, PartedNormalsStartAlikePartNoFurtherThanAllowedAndComeCloser) {
  const Target target(wavy(4));
  const FitSamples samples(target, 160);
  FitState shared = state_of(samples, wavy(1));
  FitState parted = shared;
  parted.limits.kink = 20;
  part_normals(parted);
  EXPECT_LT(largest_kink(parted.mesh), 1e-9);
  std::vector<Index> slots;
  for (Index v = 0; v < parted.mesh.positions.size(); ++v) {
    parted.mesh.slots_of(v, slots);
    EXPECT_EQ(slots.size(), parted.mesh.around[v].size());
  }
  for (int i = 0; i < 6; ++i) {
    for (FitState* state : {&shared, &parted}) {
      state->solve(i < 3 ? 2 : 8, 1);
      state->attach();
      state->measure();
    }
  }
  EXPECT_LT(parted.error(), 0.9 * shared.error());
  EXPECT_GT(largest_kink(parted.mesh), 1);
  EXPECT_LT(largest_kink(parted.mesh), 20 + 1e-9);
}

TEST(FitKink, EveryEditHoldsThemTogether) {
  const Target target(wavy(4));
  const FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(1));
  state.limits.kink = 10;
  part_normals(state);
  constexpr double any = 5;  // mm
  std::size_t merged = 0, split = 0;
  for (const auto& [u, v] : state.mesh.edges()) {
    if (state.mesh.on_edge(u, v).count() < 2) {
      continue;
    }
    if (merged < 8 && merge_edge(state, u, v, any)) {
      ++merged;
    } else if (split < 8 && split_edge(state, u, v, any)) {
      ++split;
    }
  }
  ASSERT_EQ(merged, 8U);
  ASSERT_EQ(split, 8U);
  EXPECT_LT(largest_kink(state.mesh), 10 + 1e-9);
  EXPECT_GT(largest_kink(state.mesh), 0.1);
  state.attach();
  state.measure();
  FitRegion region = cut_out(state, {3}, 2);
  region.state.solve(4, 1);
  put_back(region, state);
  EXPECT_LT(largest_kink(state.mesh), 10 + 1e-9);
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(FitKink, ACreaseIsNotHeldTogether) {
  const Target target(roof(12));
  const FitSamples samples(target, 64);
  FitState state = state_of(samples, roof(4));
  state.limits.kink = 5;
  const auto largest_at_ridge = [&] {
    double least = 180;
    std::vector<Index> slots;
    for (Index v = 0; v < state.mesh.positions.size(); ++v) {
      const Vec3& p = state.mesh.positions[v];
      if (!state.mesh.around[v].empty() && std::abs(p.y()) < 0.1 && std::abs(p.z()) < 0.1) {
        state.mesh.slots_of(v, slots);
        double largest = 0;
        for (const Index a : slots) {
          largest = std::max(largest, angle_between(state.mesh.normals[slots[0]], state.mesh.normals[a]));
        }
        least = std::min(least, largest);
      }
    }
    return least;
  };
  ASSERT_NEAR(largest_at_ridge(), 90, 1);
  part_normals(state);
  state.solve(2, 1);
  for (const auto& [u, v] : state.mesh.edges()) {
    const auto on_ridge = [&](Index node) {
      return std::abs(state.mesh.positions[node].y()) < 0.1 && std::abs(state.mesh.positions[node].z()) < 0.1;
    };
    if (on_ridge(u) && on_ridge(v) && merge_edge(state, u, v, 0.5)) {
      break;
    }
  }
  EXPECT_NEAR(largest_at_ridge(), 90, 6);
  EXPECT_LT(largest_kink(state.mesh), 5 + 1e-9);
}

TEST(FitKink, NodesWhoseNormalsPartFarAreCounted) {
  const Target target(wavy(3));
  const FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(1));
  part_normals(state);
  EXPECT_EQ(share_parted_by(state.mesh, 1e-3), 0);
  std::vector<Index> slots;
  for (const Index v : {3U, 5U}) {
    state.mesh.slots_of(v, slots);
    const auto axes = tilt_axes(state.mesh.normals[slots[0]]);
    state.mesh.normals[slots[0]] =
        (std::cos(degree * 20) * state.mesh.normals[slots[0]] + std::sin(degree * 20) * axes[0]).eval();
  }
  EXPECT_DOUBLE_EQ(share_parted_by(state.mesh, 19.9), 2.0 / 42);
  EXPECT_EQ(share_parted_by(state.mesh, 20.1), 0);
  state.mesh.slots_of(3, slots);
  state.mesh.sectors[slots[0]] = 77;  // beyond a crease they may
  EXPECT_DOUBLE_EQ(share_parted_by(state.mesh, 19.9), 1.0 / 42);
}

TEST(FitExchange, FewerShellsDoWithinTheSameLimitAndStillFewerWhereNormalsPart) {
  const Target target(wavy(3));
  FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(2));
  const double limit = 1.2;
  collapse_to(state, limit);
  ASSERT_TRUE(regains(samples, state, limit));
  squeeze(samples, state, limit);
  FitState shared = state;
  exchange_pieces(samples, shared, {limit, limit / 0.97, 0});
  EXPECT_LT(shared.mesh.alive, state.mesh.alive) << "than squeezing finds";
  exchange_pieces(samples, state, {limit, limit / 0.97, 30});
  EXPECT_LT(state.mesh.alive, shared.mesh.alive);
  EXPECT_TRUE(holds(shared, limit / 0.97));
  EXPECT_TRUE(holds(state, limit / 0.97));
  EXPECT_LT(largest_kink(shared.mesh), 1e-9);
  EXPECT_LT(largest_kink(state.mesh), 30 + 1e-9);
  for (const FitState* result : {&shared, &state}) {
    EXPECT_EQ(crossing_shells(result->mesh.shell()).size(), 0U);
    EXPECT_EQ(count_thin(*result), 0U);
    const MeshFacts facts = examine(flat_facets(result->mesh.shell()));
    EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
    EXPECT_EQ(facts.euler, 2);
  }
}

TEST(FitExchange, NormalsPartByMoreThan45DegreesOnlyWhereManyDo) {
  const Target target(wavy(4));
  for (const auto& [limit, start] : {std::pair{1.2, 2}, {0.2, 3}}) {
    FitSamples samples(target, 160);
    FitState state = state_of(samples, wavy(start));
    collapse_to(state, limit);
    ASSERT_TRUE(regains(samples, state, limit));
    ExchangeOptions options{limit, limit / 0.97, 75};
    options.rounds = limit > 1 ? 6 : 2;
    exchange_pieces(samples, state, options);
    EXPECT_LE(state.error(), limit);
    EXPECT_TRUE(holds(state, options.tolerance));
    EXPECT_LE(largest_kink(state.mesh), limit > 1 ? 75 + 1e-9 : 45 + 1e-9) << state.mesh.alive;
    if (limit > 1) {
      EXPECT_GT(largest_kink(state.mesh), 45 + 1);
    }
  }
}

}  // namespace
}  // namespace tunica
