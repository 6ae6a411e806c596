#include "tunica/cli/detail/own_stack.hpp"

#include <pthread.h>
#include <sys/resource.h>

#include <exception>

namespace tunica::cli {
namespace {

constexpr rlim_t least_stack = rlim_t{4} << 20U;

struct Work {
  const std::function<void()>& run;
  std::exception_ptr failure;
};

void* run_work(void* work) {
  auto& mine = *static_cast<Work*>(work);
  try {
    mine.run();
  } catch (...) {
    mine.failure = std::current_exception();
  }
  return nullptr;
}

bool is_enough_here() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_STACK, &limit) != 0 || limit.rlim_cur >= least_stack) {
    return true;
  }
  limit.rlim_cur = least_stack;  // the stack of a program's first thread grows to what the limit is by then
  return limit.rlim_max >= least_stack && ::setrlimit(RLIMIT_STACK, &limit) == 0;
}

}  // namespace

void with_enough_stack(const std::function<void()>& work) {
  if (is_enough_here()) {
    work();
    return;
  }
  Work mine{work, nullptr};
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, least_stack);
  pthread_t thread{};
  const bool started = pthread_create(&thread, &attributes, run_work, &mine) == 0;
  pthread_attr_destroy(&attributes);
  if (!started) {
    work();
    return;
  }
  pthread_join(thread, nullptr);
  if (mine.failure) {
    std::rethrow_exception(mine.failure);
  }
}

}  // namespace tunica::cli
