#include "tunica/core/threads.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace tunica {
namespace {

TEST(ParallelForBlocks, VisitsEveryIndexOnceInTheSameBlocksWhateverTheThreads) {
  for (const std::size_t threads : {1U, 2U, 5U}) {
    set_thread_count(threads);
    for (const std::size_t size : {0U, 1U, 7U, 8U, 9U, 1000U}) {
      std::vector<std::atomic<int>> visits(size);
      parallel_for_blocks(size, 8, [&](std::size_t begin, std::size_t end) {
        EXPECT_EQ(begin % 8, 0U);
        EXPECT_TRUE(end == size || end == begin + 8);
        for (std::size_t i = begin; i < end; ++i) {
          ++visits[i];
        }
      });
      for (const auto& count : visits) {
        EXPECT_EQ(count, 1);
      }
    }
  }
}

TEST(ParallelForBlocks, PassesOnAnException) {
  set_thread_count(2);
  EXPECT_THROW(parallel_for_blocks(100, 1,
                                   [](std::size_t begin, std::size_t) {
                                     if (begin == 42) {
                                       throw std::runtime_error("no");
                                     }
                                   }),
               std::runtime_error);
}

}  // namespace
}  // namespace tunica
