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

/// Opens what is under a name, if it is a data set. Errors are no faults: the visit goes on.
herr_t open_if_data(hid_t file, const char* name, const H5O_info_t* info, void* /*unused*/) {
  if (info->type == H5O_TYPE_DATASET) {
    (void)Handle(H5Dopen2(file, name, H5P_DEFAULT));
  }
  return 0;
}

[[noreturn]] void open_all(const std::filesystem::path& path) {
  for (const int fault : {SIGFPE, SIGSEGV, SIGBUS, SIGABRT}) {
    (void)std::signal(fault, SIG_DFL);
  }
  const rlimit none{0, 0};
  (void)setrlimit(RLIMIT_CORE, &none);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const Handle file = opened_for_reading(path);
  (void)H5Ovisit2(file.get(), H5_INDEX_NAME, H5_ITER_NATIVE, open_if_data, nullptr, H5O_INFO_BASIC);
  _exit(0);
}

}  // namespace

bool opens_without_fault(const std::filesystem::path& path) {
  const pid_t child = fork();
  if (child == 0) {
    open_all(path);
  }
  int status = 0;
  while (child > 0 && waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return !WIFSIGNALED(status);
}

}  // namespace tunica::hdf5
