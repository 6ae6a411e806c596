#include "tunica/cli/memory_limit.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"

#include <fmt/format.h>

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <utility>

namespace tunica::cli {

std::uint64_t parse_memory(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, double>, 9> units{{{"B", 1},
                                                                      {"kB", 1e3},
                                                                      {"MB", 1e6},
                                                                      {"GB", 1e9},
                                                                      {"TB", 1e12},
                                                                      {"KiB", 0x1p10},
                                                                      {"MiB", 0x1p20},
                                                                      {"GiB", 0x1p30},
                                                                      {"TiB", 0x1p40}}};
  const std::size_t digits = std::min(text.find_last_of("0123456789.") + 1, text.size());
  const std::size_t begin = std::min(text.find_first_not_of(' ', digits), text.size());
  const std::string_view unit = text.substr(begin);
  const auto number = parse_number(text.substr(0, digits));
  const auto found = std::ranges::find(units, unit, &std::pair<std::string_view, double>::first);
  const double bytes = number && found != units.end() ? *number * found->second : 0;
  if (!(bytes >= 1 && bytes < 0x1p63)) {
    throw UsageError(fmt::format(
        "'{}' is no amount of memory: give a number with kB, MB, GB, TB, KiB, MiB, GiB or TiB, such as 4GB", text));
  }
  return truncated<std::uint64_t>(bytes);
}

void MemoryLimit::set(const std::string& text) {
  const std::uint64_t bytes = parse_memory(text);
  rlimit limit{};
  if (::getrlimit(RLIMIT_DATA, &limit) != 0) {
    return;
  }
  const std::uint64_t before = limit.rlim_cur;
  limit.rlim_cur = std::min<rlim_t>(limit.rlim_cur, bytes);
  if (::setrlimit(RLIMIT_DATA, &limit) == 0) {
    before_ = before;
    text_ = text;
    std::erase(text_, ' ');
  }
}

void MemoryLimit::lift() {
  rlimit limit{};
  if (before_ && ::getrlimit(RLIMIT_DATA, &limit) == 0) {
    limit.rlim_cur = *before_;
    (void)::setrlimit(RLIMIT_DATA, &limit);
  }
  before_.reset();
}

}  // namespace tunica::cli
