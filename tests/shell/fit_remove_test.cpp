#include "shell/fit_remove.hpp"

#include "shell/fit_detach.hpp"
#include "shell/fit_states.hpp"
#include "surface/checks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace tunica {
namespace {

using testing::cylinder;
using testing::sphere;
using testing::state_of;
using testing::wavy;

constexpr double any_error = 1e9;

std::vector<Index> attached_points(const FitState& state) {
  std::vector<Index> out;
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    const auto& attached = state.patches[t].attached;
    out.insert(out.end(), attached.begin(), attached.end());
  }
  std::sort(out.begin(), out.end());
  return out;
}

/// Three nodes around, so many rings between two tips: 0 and the last are the tips.
TriangleMesh slim_tower(Index rings) {
  TriangleMesh mesh;
  mesh.vertices.push_back({0, 0, -1});
  for (Index j = 0; j < rings; ++j) {
    for (Index i = 0; i < 3; ++i) {
      const double turn = 2 * M_PI * i / 3;
      mesh.vertices.push_back({std::cos(turn), std::sin(turn), 1.2 * j});
    }
  }
  const Index tip = 3 * rings + 1;
  mesh.vertices.push_back({0, 0, 1.2 * (rings - 1) + 1});
  for (Index i = 0; i < 3; ++i) {
    const Index next = (i + 1) % 3;
    mesh.triangles.push_back({0, 1 + next, 1 + i});
    for (Index j = 0; j + 1 < rings; ++j) {
      const Index below = 1 + 3 * j, above = below + 3;
      mesh.triangles.push_back({below + i, below + next, above + next});
      mesh.triangles.push_back({below + i, above + next, above + i});
    }
    mesh.triangles.push_back({tip - 3 + i, tip - 3 + next, tip});
  }
  return mesh;
}

TEST(FitRemove, EveryNodeOfASmoothClosedMeshCanGo) {
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  const FitState whole = state_of(samples, wavy(2));
  const auto points = attached_points(whole);
  for (Index v = 0; v < whole.mesh.positions.size(); v += 7) {
    FitState state = whole;
    ASSERT_TRUE(remove_node(state, v, any_error)) << v;
    EXPECT_EQ(state.mesh.alive, whole.mesh.alive - 2);
    EXPECT_TRUE(state.mesh.around[v].empty());
    const MeshFacts facts = examine(flat_facets(state.mesh.shell()));
    EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
    EXPECT_TRUE(facts.closed);
    EXPECT_EQ(facts.euler, 2);
    EXPECT_EQ(attached_points(state), points) << "a point is lost or met twice";
    for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
      if (state.mesh.is_alive(t)) {
        EXPECT_TRUE(state.is_sound(t, state.limits.agreement, 0));
      }
    }
    double error = 0;  // of what is new
    for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
      error = std::max(error, state.mesh.triangles[t] != whole.mesh.triangles[t] ? state.patches[t].error : 0);
    }
    FitState again = whole;
    EXPECT_FALSE(remove_node(again, v, 0.9 * error)) << "the error is above the limit";
    EXPECT_EQ(again.mesh.alive, whole.mesh.alive);
    error = state.error();
    state.measure();
    EXPECT_NEAR(state.error(), error, 0.02 * error) << "as measured all at once";
  }
}

TEST(FitRemove, TheClosestTriangulationIsFound) {
  // Five nodes around the one that goes can be covered in five ways.
  const Target target(wavy(4));
  const FitSamples samples(target, 320);
  const FitState whole = state_of(samples, wavy(2));
  Index v = 0;
  while (whole.mesh.around[v].size() != 5) {
    ++v;
  }
  FitState best = whole;
  ASSERT_TRUE(remove_node(best, v, any_error));
  std::vector<Index> ring;
  whole.mesh.ring(v, ring);
  const auto error_around = [&](const FitState& state) {
    double error = 0;
    for (const Index w : ring) {
      for (const Index t : state.mesh.around[w]) {
        error = std::max(error, state.patches[t].error);
      }
    }
    return error;
  };
  best.attach();
  best.measure();
  std::size_t ways = 0;
  for (const Index w : ring) {
    // Merged into a neighbour without moving it: the fan from there.
    TriangleMesh merged = flat_facets(whole.mesh.shell());
    for (auto& c : merged.triangles) {
      std::replace(c.begin(), c.end(), v, w);
    }
    std::erase_if(merged.triangles, [](const auto& c) { return c[0] == c[1] || c[1] == c[2] || c[2] == c[0]; });
    FitMesh mesh(merged, whole.mesh.normals);
    FitState fan(samples, std::move(mesh), {});
    fan.attach();
    fan.measure();
    EXPECT_LE(error_around(best), 1.05 * error_around(fan)) << "towards " << w;
    ++ways;
  }
  EXPECT_EQ(ways, 5U);
}

TEST(FitRemove, BoundariesStayWhole) {
  const TriangleMesh mesh = cylinder(8, 4, 10, 30);
  const Target target(cylinder(32, 16, 10, 30));
  const FitSamples samples(target, mesh.triangles.size());
  const FitState whole = state_of(samples, mesh);
  std::size_t at_boundary = 0;
  for (Index v = 0; v < mesh.vertices.size(); ++v) {
    FitState state = whole;
    if (!remove_node(state, v, any_error)) {
      continue;
    }
    const bool boundary = whole.mesh.on_boundary[v] != 0;
    at_boundary += boundary ? 1 : 0;
    EXPECT_EQ(state.mesh.alive, whole.mesh.alive - (boundary ? 1 : 2));
    const TriangleMesh facets = flat_facets(state.mesh.shell());
    const MeshFacts facts = examine(facets);
    EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
    EXPECT_EQ(facts.euler, 0);
    EXPECT_EQ(boundary_loops(facets).size(), 2U);
  }
  EXPECT_EQ(at_boundary, 16U);
}

TEST(FitRemove, WhereTopologyForbidsAMergerAnotherTriangulationMayDo) {
  const TriangleMesh mesh = slim_tower(4);
  const Target target(mesh);
  const FitSamples samples(target, mesh.triangles.size());
  FitStart start;
  start.mesh = mesh;
  FitState state(samples, FitMesh(mesh, std::vector<Vec3>(mesh.vertices.size(), Vec3::UnitZ())), {});
  for (Index v = 1; v + 1 < mesh.vertices.size(); ++v) {
    const Vec3& p = mesh.vertices[v];
    state.mesh.normals[v] = Vec3(p.x(), p.y(), 0).normalized();
  }
  state.mesh.normals[0] = -Vec3::UnitZ();
  state.limits = {-0.9, 0};
  state.attach();
  state.measure();
  const Index v = 4;  // of the second ring
  EXPECT_FALSE(merge_edge(state, v, 5, any_error)) << "three nodes of a ring without a triangle";
  ASSERT_TRUE(remove_node(state, v, any_error));
  const MeshFacts facts = examine(flat_facets(state.mesh.shell()));
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_TRUE(facts.closed);
  EXPECT_EQ(facts.euler, 2);
}

TEST(FitRemove, HeldNodesCreasesAndTheLastTriangulationStay) {
  const Target target(sphere(3, 10));
  const FitSamples samples(target, 80);
  FitState state = state_of(samples, sphere(1, 10));
  state.mesh.held.assign(state.mesh.positions.size(), 0);
  state.mesh.held[3] = 1;
  EXPECT_FALSE(remove_node(state, 3, any_error));
  const Index t = state.mesh.around[5][0];
  const std::size_t corner = state.mesh.corner_of(t, 5);
  state.mesh.slots[t][corner] = state.mesh.add_slot(state.mesh.normals[5], state.mesh.fresh_sector(5));
  EXPECT_FALSE(remove_node(state, 5, any_error)) << "on a crease";
  EXPECT_EQ(state.mesh.alive, 80U);

  const TriangleMesh tetrahedron{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}},
                                 {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
  const Target solid(tetrahedron);
  const FitSamples few(solid, 4);
  FitState least = state_of(few, tetrahedron);
  least.limits = {-0.9, 0};
  EXPECT_FALSE(remove_node(least, 0, any_error));
}

TEST(FitRemove, NormalsThatMayPartAreTurnedToAgree) {
  const Target target(sphere(4, 10));
  const FitSamples samples(target, 20);
  FitState state = state_of(samples, sphere(0, 10));
  state.limits = {0.85, 0};
  FitState parting = state;
  EXPECT_FALSE(remove_node(state, 0, any_error)) << "five nodes around a corner of an icosahedron: facets turn too far";
  parting.limits.kink = 60;
  part_normals(parting);
  ASSERT_TRUE(remove_node(parting, 0, any_error));
  EXPECT_GT(testing::largest_kink(parting.mesh), 5);
  EXPECT_LT(testing::largest_kink(parting.mesh), 60 + 1e-9);
  for (Index t = 0; t < parting.mesh.triangles.size(); ++t) {
    if (parting.mesh.is_alive(t)) {
      EXPECT_TRUE(parting.is_sound(t, 0.75, 0));
    }
  }
}

}  // namespace
}  // namespace tunica
