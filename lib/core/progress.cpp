#include "tunica/core/progress.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/stop.hpp"

#include <atomic>

namespace tunica {
namespace {
std::atomic<int> stop_signal{0};
std::atomic<bool> seen{false};
static_assert(std::atomic<int>::is_always_lock_free, "request_stop() runs in a signal handler");
}  // namespace

void request_stop(int signal) noexcept {
  seen.store(false, std::memory_order_relaxed);
  stop_signal.store(signal, std::memory_order_relaxed);
}

bool stop_was_seen() noexcept { return seen.load(std::memory_order_relaxed); }

void check_interrupt() {
  if (const int signal = stop_signal.load(std::memory_order_relaxed); signal != 0) {
    seen.store(true, std::memory_order_relaxed);
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
