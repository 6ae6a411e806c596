#include "tunica/cli/detail/stop_watch.hpp"

#include "tunica/core/stop.hpp"

#include <semaphore.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <utility>

namespace tunica::cli {
namespace {

constexpr std::size_t stack_bytes = std::size_t{512} << 10U;
constexpr long long milliseconds_to_look = 1500;
constexpr long long milliseconds_to_end = 8000;
constexpr unsigned seconds_to_tell = 3;

/// Of the process, as its signals are. Posted once per signal, and once when the run is over.
struct Bells {
  Bells() {
    sem_init(&asked, 0, 0);
    sem_init(&done, 0, 0);
  }
  sem_t asked{};
  sem_t done{};
};

Bells& bells() {
  static Bells instance;
  return instance;
}

std::atomic<int> asked_by{0};

extern "C" void on_alarm(int) { std::_Exit(128 + asked_by.load()); }

/// @return whether it was posted in time
bool wait_for(sem_t& bell, long long milliseconds) {
  constexpr long long per_second = 1000, nanoseconds = 1'000'000;
  timespec until{};
  clock_gettime(CLOCK_REALTIME, &until);
  const long long end = until.tv_nsec / nanoseconds + milliseconds;
  until.tv_sec += end / per_second;
  until.tv_nsec = until.tv_nsec % nanoseconds + end % per_second * nanoseconds;
  int code = 0;
  while ((code = sem_timedwait(&bell, &until)) != 0 && errno == EINTR) {
  }
  return code == 0;
}

}  // namespace

StopWatch::StopWatch(std::function<void(int)> end) : end_(std::move(end)) {
  asked_by = 0;
  bells();  // not made first inside a signal handler
  while (sem_trywait(&bells().asked) == 0 || sem_trywait(&bells().done) == 0) {  // of an earlier run
  }
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::max<std::size_t>(stack_bytes, PTHREAD_STACK_MIN));
  watching_ = pthread_create(&thread_, &attributes, watch, this) == 0;
  pthread_attr_destroy(&attributes);
}

StopWatch::~StopWatch() {
  stand_down();
  if (watching_) {
    pthread_join(thread_, nullptr);
  }
}

void StopWatch::on_stop_signal(int signal) noexcept {
  asked_by = signal;
  sem_post(&bells().asked);
}

void StopWatch::stand_down() {
  if (over_.exchange(true)) {
    while (!ended_itself_) {  // the process ends in the other thread
      ::pause();
    }
    return;
  }
  ended_itself_ = true;
  sem_post(&bells().done);
  sem_post(&bells().asked);
}

void* StopWatch::watch(void* self) {
  auto& me = *static_cast<StopWatch*>(self);
  while (sem_wait(&bells().asked) != 0) {
  }
  if (me.over_ || wait_for(bells().done, milliseconds_to_look) ||
      (stop_was_seen() && wait_for(bells().done, milliseconds_to_end)) || me.over_.exchange(true)) {
    return nullptr;
  }
  const int signal = asked_by;
  std::signal(SIGALRM, on_alarm);  // whatever the work holds that `end` needs
  ::alarm(seconds_to_tell);
  me.end_(signal);
  std::_Exit(128 + signal);
}

}  // namespace tunica::cli
