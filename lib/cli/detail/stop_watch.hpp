#pragma once

#include <pthread.h>
#include <atomic>
#include <functional>

namespace tunica::cli {

/// Ends a run that was asked to stop and does not look: a factorisation, a tree or a file of a library has no place
/// where it could be reported. A thread that sleeps until on_stop_signal() wakes it; where none can be started, such a
/// run ends when its loops look again, as it would without this. One at a time in a process: signals belong to it.
class StopWatch {
public:
  /// @param end  called in the watching thread, while the work goes on, when nothing has looked for 1.5 s after the
  ///             signal, or what looked has not ended 8 s later. The process ends with 128 + signal when it returns, or
  ///             3 s later if it does not.
  explicit StopWatch(std::function<void(int signal)> end);
  ~StopWatch();
  StopWatch(const StopWatch&) = delete;
  StopWatch& operator=(const StopWatch&) = delete;

  /// For the signal handler: only what is safe there.
  static void on_stop_signal(int signal) noexcept;

  /// The run has come to its end by itself. Where `end` is already being called, this does not return.
  void stand_down();

private:
  static void* watch(void* self);

  std::function<void(int)> end_;
  std::atomic<bool> over_{false};
  bool watching_ = false;
  bool ended_itself_ = false;  ///< and not by `end`
  pthread_t thread_{};
};

}  // namespace tunica::cli
