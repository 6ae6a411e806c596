#pragma once

#include <cstdint>
#include <type_traits>

#ifdef __AVX2__
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace tunica {

/// 64 bytes, each 0 or 1, at an address that is a multiple of 16, to 64 bits.
inline std::uint64_t pack_bits(const std::uint8_t* flags) {
#ifdef __SSE2__
  std::uint64_t word = 0;
  for (int part = 0; part < 4; ++part) {
    const __m128i bytes = _mm_load_si128(reinterpret_cast<const __m128i*>(flags + 16 * part));
    const auto bits = static_cast<unsigned>(_mm_movemask_epi8(_mm_slli_epi16(bytes, 7)));
    word |= static_cast<std::uint64_t>(bits) << (16 * part);
  }
  return word;
#else
  std::uint64_t word = 0;
  for (int bit = 0; bit < 64; ++bit) {
    word |= static_cast<std::uint64_t>(flags[bit]) << bit;
  }
  return word;
#endif
}

/// Which of 64 values are in [first, last], as bits.
template <typename T>
std::uint64_t bits_in_range(const T* values, T first, T last) {
#ifdef __AVX2__
  if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
    // Distances from `first`, modulo the type's size, up to that of `last`: the same for signed types.
    const auto load = [](const T* from) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)); };
    const auto word = [](__m256i low, __m256i high) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(_mm256_movemask_epi8(low))) |
             static_cast<std::uint64_t>(static_cast<std::uint32_t>(_mm256_movemask_epi8(high))) << 32;
    };
    if constexpr (sizeof(T) == 1) {
      const __m256i start = _mm256_set1_epi8(static_cast<char>(first));
      const __m256i reach = _mm256_set1_epi8(static_cast<char>(last - first));
      const auto inside = [&](const T* from) {
        const __m256i distance = _mm256_sub_epi8(load(from), start);
        return _mm256_cmpeq_epi8(_mm256_min_epu8(distance, reach), distance);
      };
      return word(inside(values), inside(values + 32));
    } else {
      const __m256i start = _mm256_set1_epi16(static_cast<short>(first));
      const __m256i reach = _mm256_set1_epi16(static_cast<short>(last - first));
      const auto inside = [&](const T* from) {
        const __m256i distance = _mm256_sub_epi16(load(from), start);
        return _mm256_cmpeq_epi16(_mm256_min_epu16(distance, reach), distance);
      };
      // Packing takes halves of its arguments in turn; the permutation puts them back in order.
      const auto bytes = [&](const T* from) {
        return _mm256_permute4x64_epi64(_mm256_packs_epi16(inside(from), inside(from + 16)), 0xD8);
      };
      return word(bytes(values), bytes(values + 32));
    }
  }
#endif
  alignas(64) std::uint8_t flags[64];
  for (int bit = 0; bit < 64; ++bit) {
    flags[bit] = static_cast<std::uint8_t>((values[bit] >= first) & (values[bit] <= last));
  }
  return pack_bits(flags);
}

}  // namespace tunica
