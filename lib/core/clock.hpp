// core: errors, quantities with units, progress, threads; what every room uses.
#pragma once

#include <chrono>

namespace tunica {

/// Wall time: never set back.
using Clock = std::chrono::steady_clock;

/// s
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace tunica
