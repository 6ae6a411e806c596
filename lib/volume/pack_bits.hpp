#pragma once

#include <cstdint>

#ifdef __SSE2__
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

}  // namespace tunica
