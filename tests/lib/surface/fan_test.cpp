// A vertex with as many triangles as the mesh: what walks around a vertex for every triangle there would take minutes.
#include "surface/shapes.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/decimation/detail/edit_mesh.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

constexpr std::size_t count = 200'000;

class Fan : public testing::TestWithParam<std::tuple<bool, bool>> {
protected:
  const bool closed_ = std::get<0>(GetParam());
  const TriangleMesh mesh_ = shapes::fan(count, closed_, std::get<1>(GetParam()));
};

INSTANTIATE_TEST_SUITE_P(OpenOrClosedTipFirstOrLast, Fan, testing::Combine(testing::Bool(), testing::Bool()));

TEST_P(Fan, IsExamined) {
  const MeshFacts facts = examine(mesh_);
  EXPECT_FALSE(why_unfit(facts));
  EXPECT_EQ(facts.closed, closed_);
  EXPECT_EQ(facts.euler, closed_ ? 2 : 1);
}

TEST_P(Fan, HasNeighboursAndLoops) {
  const auto across = neighbours(mesh_, incidence(mesh_));
  for (const auto& [a, b, c] : across) {
    EXPECT_EQ((a == no_neighbour) + (b == no_neighbour) + (c == no_neighbour), closed_ ? 0 : 1);
  }
  const auto loops = boundary_loops(mesh_);
  ASSERT_EQ(loops.size(), closed_ ? 0U : 1U);
  EXPECT_EQ(boundary_loops(mesh_.triangles, across), loops);
}

TEST_P(Fan, IsEdited) {
  const EditMesh edited(mesh_);
  EXPECT_EQ(edited.edges().size(), closed_ ? 3 * count : 2 * count);
}

TEST_P(Fan, IsDecimated) {
  DecimateOptions options;
  options.triangles = 1000;
  options.levelled = false;
  const DecimateResult result = decimate(mesh_, options);
  EXPECT_TRUE(result.count_reached);
  EXPECT_FALSE(why_unfit(examine(result.mesh)));
}

}  // namespace
}  // namespace tunica
