#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <string_view>

/// Deterministic damage to files, for tests that throw hostile bytes at a reader.
namespace tunica::test {

/// One damaged copy of `bytes`; the same seed gives the same copy on every machine. One to four of: bits flipped, the
/// end cut off, bytes replaced by extreme ones, a block repeated, removed, moved or zeroed, a decimal number of the
/// text replaced by an extreme one, a 4-byte word replaced by an extreme one.
inline std::string mutate(std::string_view bytes, std::uint64_t seed) {
  static constexpr std::array<std::string_view, 14> numbers = {"0",
                                                               "-1",
                                                               "1",
                                                               "2147483647",
                                                               "2147483648",
                                                               "4294967295",
                                                               "18446744073709551615",
                                                               "99999999999999999999999",
                                                               "nan",
                                                               "inf",
                                                               "1e999",
                                                               "-1.5e300",
                                                               "1e-320",
                                                               "4"};
  static constexpr std::array<std::uint32_t, 9> words = {0,          1,          0x7fffffff, 0x80000000, 0xffffffff,
                                                         0x7f800000, 0x7fc00000, 0x00ffffff, 0x01000000};
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15ULL + 1);
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : static_cast<std::size_t>(random() % n); };
  // Half of the damage goes to the first kilobyte, where headers are.
  const auto place = [&](std::size_t size) {
    return random() % 2 == 0 ? below(size) : below(std::min<std::size_t>(size, 1024));
  };
  std::string text(bytes);
  for (std::size_t rounds = 1 + below(4); rounds > 0; --rounds) {
    if (text.empty()) {
      return text;
    }
    const std::size_t at = place(text.size());
    const std::size_t length = 1 + below(std::min<std::size_t>(text.size() - at, 64));
    switch (below(9)) {
      case 0:
        text[at] = static_cast<char>(text[at] ^ (1 << below(8)));
        break;
      case 1:
        text.resize(below(text.size()));
        break;
      case 2:
        text[at] = static_cast<char>(std::array<unsigned char, 5>{0x00, 0x7f, 0x80, 0xff, '\n'}[below(5)]);
        break;
      case 3:
        text.insert(at, text.substr(at, length));
        break;
      case 4:
        text.erase(at, length);
        break;
      case 5:
        std::fill_n(text.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
        break;
      case 6: {
        const std::string block = text.substr(at, length);
        text.erase(at, length);
        text.insert(place(text.size()), block);
        break;
      }
      case 7: {
        const std::size_t begin = text.find_first_of("0123456789", at);
        if (begin != std::string::npos) {
          const std::size_t end = std::min(text.find_first_not_of("0123456789.+-eE", begin), text.size());
          text.replace(begin, end - begin, numbers[below(numbers.size())]);
        }
        break;
      }
      default:
        if (at + 4 <= text.size()) {
          const std::uint32_t word = words[below(words.size())];
          for (std::size_t k = 0; k < 4; ++k) {
            text[at + k] = static_cast<char>(word >> (8 * k));
          }
        }
    }
  }
  return text;
}

}  // namespace tunica::test
