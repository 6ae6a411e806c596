#pragma once

#include <functional>

namespace tunica {

/// Called now and then by a long algorithm with the fraction done, in [0, 1], from one thread at a time.
using Progress = std::function<void(double fraction)>;

/// Asks every running algorithm to stop at its next check_interrupt(). Safe inside a signal handler.
void request_stop(int signal) noexcept;

/// Throws Interrupted when request_stop() was called. Cheap (one relaxed atomic read): call it in every outer loop.
void check_interrupt();

/// check_interrupt(), then tells `progress` when there is one.
void advance(const Progress& progress, double fraction);

}  // namespace tunica
