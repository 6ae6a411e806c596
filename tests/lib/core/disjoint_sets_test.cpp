#include "tunica/core/disjoint_sets.hpp"

#include <gtest/gtest.h>

namespace tunica {
namespace {

TEST(DisjointSets, TheSmallestElementStandsForItsSet) {
  DisjointSets sets(6);
  EXPECT_TRUE(sets.join(5, 3));
  EXPECT_TRUE(sets.join(4, 5));
  EXPECT_FALSE(sets.join(3, 4));
  EXPECT_TRUE(sets.join(0, 2));
  const std::array<Index, 6> roots{0, 1, 0, 3, 3, 3};
  for (Index i = 0; i < 6; ++i) {
    EXPECT_EQ(sets.root(i), roots[i]);
  }
}

}  // namespace
}  // namespace tunica
