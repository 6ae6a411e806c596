#include "tunica/core/progress.hpp"

#include "tunica/core/error.hpp"

#include <atomic>

namespace tunica {
namespace {
std::atomic<int> stop_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "request_stop() runs in a signal handler");
}  // namespace

void request_stop(int signal) noexcept { stop_signal.store(signal, std::memory_order_relaxed); }

void check_interrupt() {
  if (const int signal = stop_signal.load(std::memory_order_relaxed); signal != 0) {
    throw Interrupted(signal);
  }
}

void advance(const Progress& progress, double fraction) {
  check_interrupt();
  if (progress) {
    progress(fraction);
  }
}

}  // namespace tunica
