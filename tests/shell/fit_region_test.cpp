#include "shell/fit_region.hpp"

#include "shell/fit_detach.hpp"
#include "shell/fit_edit.hpp"
#include "shell/fit_states.hpp"
#include "surface/checks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace tunica {
namespace {

using testing::state_of;
using testing::wavy;

std::vector<std::array<double, 10>> sorted_triangles(const FitState& state) {
  std::vector<std::array<double, 10>> out;
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    if (state.mesh.is_alive(t)) {
      const auto c = state.mesh.corners(t);
      const std::size_t first =
          static_cast<std::size_t>(std::min_element(c.begin(), c.end(),
                                                    [](const Vec3& a, const Vec3& b) {
                                                      return std::tie(a[0], a[1], a[2]) < std::tie(b[0], b[1], b[2]);
                                                    }) -
                                   c.begin());
      const Vec3 &p = c[first], &q = c[(first + 1) % 3], &r = c[(first + 2) % 3];
      out.push_back({p[0], p[1], p[2], q[0], q[1], q[2], r[0], r[1], r[2], state.patches[t].error});
    }
  }
  std::sort(out.begin(), out.end());
  return out;
}

TEST(FitRegion, PutBackUnchangedNothingHasChanged) {
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, wavy(2));
  const auto before = sorted_triangles(state);
  const FitRegion region = cut_out(state, {3, 40}, 1);
  ASSERT_LT(region.state.mesh.alive, 60U);
  EXPECT_EQ(region.state.mesh.alive, region.triangles.size());
  EXPECT_LE(put_back(region, state), state.error());
  const auto after = sorted_triangles(state);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    for (std::size_t k = 0; k < 9; ++k) {
      EXPECT_EQ(after[i][k], before[i][k]);
    }
    EXPECT_NEAR(after[i][9], before[i][9], 1e-9);
  }
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(FitRegion, PatchesAtTheRimGapeAtWhatIsBeyond) {
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, wavy(2));
  state.limits.kink = 45;
  part_normals(state);
  for (std::size_t s = 0; s < state.mesh.normals.size(); ++s) {
    const double a = 3.1 * static_cast<double>(s);
    state.mesh.normals[s] =
        (state.mesh.normals[s] + 0.3 * Vec3(std::sin(a), std::cos(1.7 * a), std::sin(2.3 * a))).normalized();
  }
  state.measure();
  std::size_t blind = 0;
  for (const bool heed_rim : {false, true}) {
    FitRegion region = cut_out(state, {3}, 1, heed_rim);
    region.state.measure();
    for (std::size_t i = 0; i < region.triangles.size(); ++i) {
      const double own = region.state.patches[i].error, whole = state.patches[region.triangles[i]].error;
      if (heed_rim) {
        EXPECT_NEAR(own, whole, 1e-9);
      } else {
        EXPECT_LE(own, whole + 1e-9);
        blind += own < 0.99 * whole ? 1 : 0;
      }
    }
    for (const auto& edge : region.state.mesh.cut) {
      const auto there = region.state.mesh.points_beyond(edge.nodes[0], edge.nodes[1]);
      const auto back = region.state.mesh.points_beyond(edge.nodes[1], edge.nodes[0]);
      ASSERT_EQ(there.has_value(), heed_rim);
      EXPECT_TRUE(!there || ((*there)[0] == (*back)[2] && (*there)[2] == (*back)[0]));
    }
  }
  EXPECT_GT(blind, 0U);
}

TEST(FitRegion, TheRimIsHeld) {
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, wavy(2));
  FitRegion region = cut_out(state, {3}, 1);
  FitState& piece = region.state;
  const FitMesh old = piece.mesh;
  const std::size_t held = static_cast<std::size_t>(std::count(old.held.begin(), old.held.end(), 1));
  ASSERT_GT(held, 6U);
  ASSERT_LT(held, old.positions.size());
  piece.solve(2, 1);
  std::size_t moved = 0;
  std::vector<Index> slots;
  for (Index v = 0; v < old.positions.size(); ++v) {
    old.slots_of(v, slots);
    const bool still =
        piece.mesh.positions[v] == old.positions[v] && piece.mesh.normals[slots[0]] == old.normals[slots[0]];
    EXPECT_TRUE(still || !old.is_held(v));
    moved += still ? 0 : 1;
    if (old.is_held(v)) {
      EXPECT_FALSE(move_node(piece, v, old.positions[v], 0, 1e9));
    }
  }
  EXPECT_GT(moved, 0U);
  for (const auto& [u, v] : piece.mesh.edges()) {
    if (piece.mesh.is_held(u) || piece.mesh.is_held(v)) {
      EXPECT_FALSE(merge_edge(piece, u, v, 1e9));
    }
    if (piece.mesh.is_held(u) && piece.mesh.is_held(v) && piece.mesh.on_edge(u, v).count() == 1) {
      EXPECT_FALSE(split_edge(piece, u, v, 1e9));
    }
  }
}

TEST(FitRegion, AChangedPieceFitsItsSurroundings) {
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  FitState state = state_of(samples, wavy(2));
  FitRegion region = cut_out(state, {3}, 2);
  const auto free = [&](Index v) { return !region.state.mesh.is_held(v); };
  bool merged = false, split = false;
  for (const auto& [u, v] : region.state.mesh.edges()) {
    if (!merged && free(u) && free(v)) {
      merged = merge_edge(region.state, u, v, 5);
    } else if (!split && region.state.mesh.on_edge(u, v).count() == 2) {
      split = split_edge(region.state, u, v, 5);
    }
  }
  ASSERT_TRUE(merged && split);
  const double error = put_back(region, state);
  EXPECT_EQ(state.mesh.alive, 320U);
  const MeshFacts facts = examine(flat_facets(state.mesh.shell()));
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_EQ(facts.euler, 2);
  EXPECT_TRUE(facts.closed);
  EXPECT_LE(error, state.error());
  state.measure();
  EXPECT_GE(state.error(), error * 0.999);
}

}  // namespace
}  // namespace tunica
