#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tunica::cli {

/// Reads an amount of memory with its unit, e.g. "500MB", "1.5 GiB": kB, MB, GB, TB in powers of 1000, KiB, MiB, GiB,
/// TiB in powers of 1024. @return bytes. Errors: UsageError, also for a bare number and for less than a byte.
std::uint64_t parse_memory(std::string_view text);

/// A limit on the memory of this process. The system counts all that is the process's own and can be written to,
/// whether it has been touched or not: its heap and the stacks of its threads, but not program, libraries and files
/// that are mapped (RLIMIT_DATA). Asking for more fails as if there were none: std::bad_alloc.
class MemoryLimit {
public:
  /// Sets it. A lower limit that holds already stays.
  void set(const std::string& text);

  /// Takes it back, so that what there is to say about its end can be said.
  void lift();

  /// As it was given to set(), without blanks; empty where none was.
  [[nodiscard]] const std::string& text() const { return text_; }

private:
  std::string text_;
  std::optional<std::uint64_t> before_;  ///< the system's
};

}  // namespace tunica::cli
