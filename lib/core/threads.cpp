#include "tunica/core/threads.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <sched.h>
#ifdef TUNICA_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <memory>
#include <string_view>

namespace tunica {
namespace {

std::size_t usable_processors() {
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) {
    return narrow<std::size_t>(std::max(1, CPU_COUNT(&set)));
  }
  return 1;
}

struct Limit {
  std::size_t count = usable_processors();
  std::unique_ptr<tbb::global_control> control;
};

Limit& limit() {
  static Limit instance;
  return instance;
}

/// What the thread sanitizer cannot see, because TBB is not built for it: blocks begin after all that was done before
/// them, and what follows comes after they ended. Of the order of blocks it is told nothing, so that it finds their
/// races. This file is not instrumented itself (CMakeLists.txt): TBB's tasks are made here and run elsewhere.
class Order {
public:
  Order() { release(begin_); }
  ~Order() { acquire(end_); }
  Order(const Order&) = delete;
  Order& operator=(const Order&) = delete;

  /// While one of the blocks runs.
  class Block {
  public:
    explicit Block(Order& order) : order_(order) { acquire(order_.begin_); }
    ~Block() { release(order_.end_); }
    Block(const Block&) = delete;
    Block& operator=(const Block&) = delete;

  private:
    Order& order_;
  };

private:
#ifdef TUNICA_THREAD_SANITIZER
  static void acquire(char& place) { __tsan_acquire(&place); }
  static void release(char& place) { __tsan_release(&place); }
#else
  static void acquire(char&) {}
  static void release(char&) {}
#endif

  char begin_ = 0;
  char end_ = 0;
};

}  // namespace

void set_thread_count(std::size_t count) {
  TUNICA_ASSERT(count >= 1);
  Limit& l = limit();
  l.count = count;
  l.control = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, count);
}

std::size_t thread_count() { return limit().count; }

std::size_t default_thread_count() {
  for (const char* name : {"TUNICA_THREADS", "SLURM_CPUS_PER_TASK"}) {
    const char* const value = std::getenv(name);
    if (value == nullptr || *value == '\0') {
      continue;
    }
    const std::string_view text(value);
    std::size_t count = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (error != std::errc{} || end != text.data() + text.size() || count == 0 || count > 4096) {
      throw UsageError(
          fmt::format("{}='{}' is not a number of threads: write a whole number from 1 to 4096", name, text));
    }
    return count;
  }
  return usable_processors();
}

void parallel_for_blocks(std::size_t size, std::size_t grain,
                         const std::function<void(std::size_t begin, std::size_t end)>& body) {
  TUNICA_ASSERT(grain >= 1);
  const std::size_t blocks = (size + grain - 1) / grain;
  const auto run = [&](std::size_t block) {
    check_interrupt();
    body(block * grain, std::min(size, (block + 1) * grain));
  };
  if (blocks <= 1 || thread_count() == 1) {
    for (std::size_t block = 0; block < blocks; ++block) {
      run(block);
    }
    return;
  }
  Order order;
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
    const Order::Block running(order);
    run(block);
  });
}

}  // namespace tunica
