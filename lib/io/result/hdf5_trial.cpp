#include "tunica/io/result/detail/hdf5_trial.hpp"

#include "tunica/io/result/detail/hdf5_file.hpp"

#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

namespace tunica::hdf5 {
namespace {

[[noreturn]] void open_all(const std::filesystem::path& path, std::span<const char* const> datasets) {
  for (const int fault : {SIGFPE, SIGSEGV, SIGBUS, SIGABRT}) {
    (void)std::signal(fault, SIG_DFL);
  }
  const rlimit none{0, 0};
  (void)setrlimit(RLIMIT_CORE, &none);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const Handle file = opened_for_reading(path);
  for (const char* const dataset : datasets) {
    (void)Handle(H5Dopen2(file.get(), dataset, H5P_DEFAULT));
  }
  _exit(0);
}

}  // namespace

bool opens_without_fault(const std::filesystem::path& path, std::span<const char* const> datasets) {
  const pid_t child = fork();
  if (child == 0) {
    open_all(path, datasets);
  }
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return !WIFSIGNALED(status);
}

}  // namespace tunica::hdf5
