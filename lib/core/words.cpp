#include "tunica/core/words.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace tunica {
namespace {

// 0, or errno.
int write_all(int descriptor, std::string_view text) noexcept {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written >= 0) {
      text.remove_prefix(narrow<std::size_t>(written));
    } else if (errno == EAGAIN) {
      pollfd ready{descriptor, POLLOUT, 0};
      (void)::poll(&ready, 1, -1);
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

}  // namespace

void occupy_standard_descriptors() noexcept {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(descriptor, F_GETFD) < 0) {
      // A folder: always there, and neither read nor written. The lowest free number is this one.
      (void)::open("/", O_RDONLY | O_DIRECTORY);
    }
  }
}

std::string shell_quoted(const std::string& word) {
  const bool plain = !word.empty() && word.find_first_not_of(
                                          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                          "0123456789_-+./,:=%@{}") == std::string::npos;
  if (plain) {
    return word;
  }
  std::string quoted = "'";
  for (const char c : word) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

void say(std::string_view text) noexcept { (void)write_all(STDERR_FILENO, text); }

void print(std::string_view text) {
  if (const int why = write_all(STDOUT_FILENO, text); why != 0) {
    throw OutputError(std::string("standard output: cannot be written: ") + std::strerror(why) +
                      "; send it to a file or a program that reads it to the end");
  }
}

}  // namespace tunica
