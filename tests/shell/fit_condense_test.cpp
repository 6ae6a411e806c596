// Many shells become fewer by less error everywhere, and dense targets are fitted by what stands in for them.
#include "shell/fit_condense.hpp"
#include "shell/fit.hpp"
#include "shell/fit_cross.hpp"
#include "shell/fit_squeeze.hpp"
#include "shell/fit_start.hpp"
#include "shell/fit_states.hpp"
#include "shell/shell_distance.hpp"
#include "surface/checks.hpp"
#include "surface/hausdorff.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunica {
namespace {

using testing::collapse_to;
using testing::state_of;
using testing::wavy;

void expect_sound_ball(const FitState& state, double limit) {
  EXPECT_LE(state.error(), limit);
  EXPECT_EQ(crossing_shells(state.mesh.shell()).size(), 0U);
  const MeshFacts facts = examine(flat_facets(state.mesh.shell()));
  EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
  EXPECT_EQ(facts.euler, 2);
}

TEST(FitCondense, LessErrorEverywhereMakesRoomForMergersAndMoreSoWhereNormalsPart) {
  const Target target(wavy(4));
  const double limit = 0.08;
  FitSamples samples(target, 160);
  FitState state = state_of(samples, wavy(3));
  collapse_to(state, limit);
  ASSERT_TRUE(regains(samples, state, limit));
  FitState condensed = state;
  condense(samples, condensed, {limit, 0, 8});
  EXPECT_LE(condensed.mesh.alive, 0.93 * static_cast<double>(state.mesh.alive));
  expect_sound_ball(condensed, limit);
  CondenseOptions options{limit, 45};
  condense_parted(samples, state, options);
  EXPECT_LE(state.mesh.alive, condensed.mesh.alive);
  EXPECT_EQ(state.limits.kink, 45);
  EXPECT_LE(testing::largest_kink(state.mesh), 45.01);
  expect_sound_ball(state, limit);
}

TEST(FitCondense, ManyShellsCondenseInPiecesAndWhatCertificatesFindIsMended) {
  const Target target(wavy(5));
  const double tolerance = 0.008, limit = 0.97 * tolerance;
  FitSamples samples(target, 700);
  FitState state = state_of(samples, wavy(4));
  collapse_to(state, limit);
  ASSERT_GT(state.mesh.alive, 500U);
  std::size_t condensed = 0;
  for (const double exchanging : {0.0, 1.0}) {
    const RelaxOptions options;
    FitResult result(target, options, 1e-3 * tolerance, true);
    FitSamples its_samples = samples;
    FitState trial(its_samples, state.mesh, state.limits);
    trial.attach_closely();
    trial.measure();
    CondenseOptions condensing{limit, 45};
    condensing.exchanging = exchanging;
    ASSERT_TRUE(condense_certainly(its_samples, trial, result, tolerance, condensing));
    EXPECT_LE(result.found.distance.upper(), tolerance);
    EXPECT_EQ(result.found.shell.triangles.size(), trial.mesh.alive);
    const MeshFacts facts = examine(flat_facets(trial.mesh.shell()));
    EXPECT_FALSE(why_unfit(facts)) << why_unfit(facts).value_or("");
    EXPECT_EQ(facts.euler, 2);
    if (exchanging == 0) {
      condensed = trial.mesh.alive;
      EXPECT_LE(condensed, 0.92 * static_cast<double>(state.mesh.alive));
    } else {
      EXPECT_LT(trial.mesh.alive, condensed);
    }
  }
}

TEST(FitCondense, FurtherPlacesOfAPatchAreMeasuredUntilItIsAnother) {
  const Target target(testing::sphere(4, 10));
  FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  const std::size_t before = state.patches[7].residuals.size();
  const Vec2 at(0.31, 0.17);
  state.patches[7].places.push_back(at);
  state.measure();
  ASSERT_EQ(state.patches[7].residuals.size(), before + 1);
  const Vec3 p = state.mesh.patch(7).point(at);
  EXPECT_TRUE(std::any_of(state.patches[7].residuals.begin(), state.patches[7].residuals.end(), [&](const Residual& r) {
    return r.at == at && std::abs(std::abs(r.distance) - (target.closest(p).point - p).norm()) < 1e-9;
  }));
  state.mesh.positions[state.mesh.triangles[7][0]] *= 1.01;
  EXPECT_TRUE(move_node(state, state.mesh.triangles[7][0],
                        10.0 * Vec3(state.mesh.positions[state.mesh.triangles[7][0]]).normalized(), 0, 1e9));
  EXPECT_TRUE(state.patches[7].places.empty());
}

TEST(FitCondense, PiecesAreMendedWithoutTheOthers) {
  const Target target(testing::sphere(4, 10));
  FitSamples samples(target, 320);
  FitState state = state_of(samples, testing::sphere(2, 10));
  const double limit = 1.5 * state.error();
  state.mesh.positions[0] *= 1.05;
  state.attach_again();
  state.measure();
  ASSERT_GT(state.error(), 2 * limit);
  const std::vector<Vec3> before = state.mesh.positions;
  EXPECT_EQ(mend_pieces(state, limit), 0U);
  EXPECT_LE(state.error(), limit);
  std::size_t moved = 0;
  for (std::size_t v = 0; v < before.size(); ++v) {
    moved += state.mesh.positions[v] != before[v] ? 1 : 0;
  }
  EXPECT_GT(moved, 0U);
  EXPECT_LT(moved, before.size() / 4);
}

TEST(FitCondense, MergersOfAllThatCanGoEnd) {
  // Without its caps: what is left at two boundaries cannot go.
  TriangleMesh open = wavy(3);
  std::erase_if(open.triangles, [&](const auto& t) { return std::abs(open.vertices[t[0]].z()) > 7; });
  const Target target(open);
  FitSamples samples(target, 40);
  FitState state = state_of(samples, target.mesh());
  state.limits.angle = 1;
  EXPECT_GT(collapse_edges(state, std::numeric_limits<double>::infinity(), 0, {}), 100U);
  EXPECT_GE(state.mesh.alive, 6U);
  EXPECT_EQ(examine(flat_facets(state.mesh.shell())).boundary_loops, 2U);
}

TEST(FitStandIn, IsCoarserAsCloseAsAskedForAndThereForDenseTargetsOnly) {
  EXPECT_FALSE(stand_in_for(Target(wavy(4)), 1));
  const Target dense(wavy(6));
  const double flat_error = 0.01;
  const auto found = stand_in_for(dense, flat_error);
  ASSERT_TRUE(found);
  EXPECT_LE(found->mesh.triangles.size(), dense.mesh().triangles.size() / 4);
  EXPECT_LE(found->flat_error, flat_error);
  HausdorffOptions measuring;
  measuring.width = flat_error / 20;
  measuring.samples = 0;
  EXPECT_LE(hausdorff(found->mesh, dense.mesh(), measuring).both.lower, 1.3 * found->flat_error);
  EXPECT_FALSE(stand_in_for(dense, 1e-6));
}

TEST(FitStandIn, TheToleranceHoldsForTheTargetItself) {
  const Target dense(wavy(6));
  RelaxOptions options;
  options.method = RelaxMethod::fit;
  options.tolerance = 0.15;
  options.effort = 0.1;
  const RelaxResult found = fit(dense.mesh(), dense, options);
  ASSERT_TRUE(found.reached.value_or(false));
  ShellDistanceOptions measuring;
  measuring.width = 0.01 * *options.tolerance;
  EXPECT_LE(shell_distance(found.shell, dense, measuring).both.lower, *options.tolerance);
  EXPECT_LT(found.shell.triangles.size(), 200U);
}

}  // namespace
}  // namespace tunica
