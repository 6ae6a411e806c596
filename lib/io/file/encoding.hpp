// io/file: outputs that are whole or absent; what the readers share; bytes as text.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

/// Bytes as other bytes or as text, for files that carry data inside: deflate, base64, SHA-256.
namespace tunica {

/// Bytes that one byte of deflate stands for at the most: 258 from two bits, and a little for headers and the block at
/// the end.
inline constexpr std::uint64_t deflate_expansion = 1032;

/// RFC 1950 (zlib) at its best level: what a browser's DecompressionStream calls "deflate". Cost: some 10 MB/s.
std::string deflated(std::string_view bytes);

/// RFC 4648, with padding.
std::string base64(std::string_view bytes);

/// The 32 bytes of the SHA-256 of a text, in base64: a source of a content security policy is 'sha256-' and this.
std::string sha256_base64(std::string_view bytes);

}  // namespace tunica
