#include "shell/fit_divide.hpp"

#include "core/threads.hpp"
#include "shell/fit_states.hpp"
#include "surface/checks.hpp"

#include <gtest/gtest.h>

#include <mutex>
#include <set>

namespace tunica {
namespace {

using testing::state_of;
using testing::wavy;

constexpr std::size_t shells_per_piece = 150;

/// Moves what may move outwards a little.
void inflate(FitSamples&, FitState& piece) {
  for (Index v = 0; v < piece.mesh.positions.size(); ++v) {
    if (!piece.mesh.is_held(v)) {
      piece.mesh.positions[v] *= 1.001;
    }
  }
}

std::set<Index> moved_by(FitSamples& samples, FitState& state, int turn) {
  const std::vector<Vec3> before = state.mesh.positions;
  change_pieces(samples, state, shells_per_piece, turn, inflate);
  std::set<Index> moved;
  for (Index v = 0; v < before.size(); ++v) {
    if (state.mesh.positions[v] != before[v]) {
      moved.insert(v);
    }
  }
  return moved;
}

TEST(FitDivide, NothingChangedIsNothingChanged) {
  const Target target(wavy(4));
  FitSamples samples(target, 1280);
  FitState state = state_of(samples, wavy(3));
  const double error = state.error();
  const std::size_t alive = state.mesh.alive, points = samples.points().size();
  std::mutex counting;
  std::size_t pieces = 0, triangles = 0, heeded = 0;
  change_pieces(samples, state, shells_per_piece, 0, [&](FitSamples& of_piece, FitState& piece) {
    const std::lock_guard<std::mutex> lock(counting);
    ++pieces;
    triangles += piece.mesh.alive;
    heeded += of_piece.points().size();
    EXPECT_GT(of_piece.further_points().size(), 0U);
    EXPECT_EQ(&piece.samples(), &of_piece);
    EXPECT_LE(piece.error(), 1.001 * error);
  });
  EXPECT_EQ(pieces, 8U);
  EXPECT_LT(triangles, alive) << "what is between the rims belongs to none";
  EXPECT_GT(triangles, alive / 2);
  EXPECT_LT(heeded, points);
  EXPECT_EQ(state.mesh.alive, alive);
  EXPECT_LE(state.error(), 1.001 * error);
  EXPECT_EQ(samples.points().size(), points);
  EXPECT_FALSE(why_unfit(examine(flat_facets(state.mesh.shell()))));
}

TEST(FitDivide, OtherTurnsFreeOtherNodes) {
  const Target target(wavy(4));
  FitSamples samples(target, 1280);
  FitState state = state_of(samples, wavy(3));
  std::set<Index> ever;
  for (int turn = 0; turn < 4; ++turn) {
    const std::set<Index> moved = moved_by(samples, state, turn);
    EXPECT_GT(moved.size(), state.mesh.positions.size() / 4);
    EXPECT_LT(moved.size(), state.mesh.positions.size());
    ever.insert(moved.begin(), moved.end());
  }
  EXPECT_GT(ever.size(), 95 * state.mesh.positions.size() / 100);
}

TEST(FitDivide, PointsThatAPieceGainsAreKeptAndAttachedWhereTheyBelong) {
  const Target target(wavy(4));
  FitSamples samples(target, 1280);
  FitState state = state_of(samples, wavy(3));
  const std::size_t before = samples.points().size();
  change_pieces(samples, state, shells_per_piece, 1, [](FitSamples& of_piece, FitState& piece) {
    Index t = 0;
    while (!piece.mesh.is_alive(t)) {
      ++t;
    }
    piece.patches[t].attached.push_back(static_cast<Index>(of_piece.points().size()));
    of_piece.add({of_piece.target().closest(piece.mesh.patch(t).point({1.0 / 3, 1.0 / 3})).point});
    piece.measure();
  });
  EXPECT_EQ(samples.points().size(), before + 8);
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    for (const Index p : state.patches[t].attached) {
      ASSERT_LT(p, samples.points().size());
      if (p >= before) {
        EXPECT_LE(std::sqrt(foot_on_patch(state.mesh.patch(t), samples.points()[p].point).squared_distance),
                  state.error());
      }
    }
  }
}

TEST(FitDivide, TheNumberOfThreadsChangesNothing) {
  const Target target(wavy(4));
  const std::size_t usual = thread_count();
  std::vector<std::vector<Vec3>> found;
  for (const std::size_t threads : {1, 3}) {
    set_thread_count(threads);
    FitSamples samples(target, 1280);
    FitState state = state_of(samples, wavy(3));
    change_pieces(samples, state, shells_per_piece, 0, inflate);
    found.push_back(state.mesh.positions);
  }
  set_thread_count(usual);
  EXPECT_EQ(found[0], found[1]);
}

}  // namespace
}  // namespace tunica
