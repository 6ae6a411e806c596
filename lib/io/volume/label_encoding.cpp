// Text as spreadsheets and older programs write it, to UTF-8. Of RFC 3629 and 2781; Windows-1252 by the Unicode
// Consortium's table, of which Latin-1 is the part that text uses.

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/volume/detail/label_table.hpp"

#include <fmt/format.h>

#include <array>

namespace tunica::volume_format {
namespace {

void append(std::string& text, std::uint32_t code) {
  const auto put = [&](std::uint32_t byte) { text += static_cast<char>(static_cast<unsigned char>(byte)); };
  if (code < 0x80) {
    put(code);
  } else if (code < 0x800) {
    put(0xc0 | code >> 6);
    put(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    put(0xe0 | code >> 12);
    put(0x80 | (code >> 6 & 0x3f));
    put(0x80 | (code & 0x3f));
  } else {
    put(0xf0 | code >> 18);
    put(0x80 | (code >> 12 & 0x3f));
    put(0x80 | (code >> 6 & 0x3f));
    put(0x80 | (code & 0x3f));
  }
}

std::uint32_t byte_at(std::string_view bytes, std::size_t at) { return static_cast<unsigned char>(bytes[at]); }

// Bytes of the character that begins here; 0 where none does.
std::size_t utf8_length(std::string_view rest) {
  const std::uint32_t first = byte_at(rest, 0);
  const std::size_t length = first < 0x80   ? 1
                             : first < 0xc2 ? 0
                             : first < 0xe0 ? 2
                             : first < 0xf0 ? 3
                             : first < 0xf5 ? 4
                                            : 0;
  if (length == 0 || rest.size() < length) {
    return 0;
  }
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte_at(rest, i) & 0xc0) != 0x80) {
      return 0;
    }
  }
  // Neither longer than it need be, nor half a pair of UTF-16, nor beyond the last code.
  const std::uint32_t second = length > 1 ? byte_at(rest, 1) : 0;
  const bool wrong = (first == 0xe0 && second < 0xa0) || (first == 0xed && second >= 0xa0) ||
                     (first == 0xf0 && second < 0x90) || (first == 0xf4 && second >= 0x90);
  return wrong ? 0 : length;
}

bool is_utf8(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = utf8_length(text.substr(at));
    if (length == 0) {
      return false;
    }
    at += length;
  }
  return true;
}

std::string from_windows_1252(std::string_view bytes) {
  constexpr std::array<std::uint16_t, 32> codes{0x20ac, 0x81,   0x201a, 0x0192, 0x201e, 0x2026, 0x2020, 0x2021,
                                                0x02c6, 0x2030, 0x0160, 0x2039, 0x0152, 0x8d,   0x017d, 0x8f,
                                                0x90,   0x2018, 0x2019, 0x201c, 0x201d, 0x2022, 0x2013, 0x2014,
                                                0x02dc, 0x2122, 0x0161, 0x203a, 0x0153, 0x9d,   0x017e, 0x0178};
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    const std::uint32_t byte = byte_at(bytes, at);
    append(text, byte >= 0x80 && byte < 0xa0 ? codes.at(byte - 0x80) : byte);
  }
  return text;
}

std::string from_utf16(const std::filesystem::path& path, std::string_view bytes, bool big_endian) {
  const auto unit = [&](std::size_t at) {
    return big_endian ? byte_at(bytes, at) << 8 | byte_at(bytes, at + 1)
                      : byte_at(bytes, at + 1) << 8 | byte_at(bytes, at);
  };
  const auto damaged = [&](std::size_t at) {
    throw InputError(
        fmt::format("{}: is UTF-16 text that is damaged at byte {}: save it as UTF-8", path.string(), at + 2));
  };
  if (bytes.size() % 2 != 0) {
    damaged(bytes.size() - 1);
  }
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += 2) {
    const std::uint32_t first = unit(at);
    if (first < 0xd800 || first >= 0xe000) {
      append(text, first);
      continue;
    }
    const std::uint32_t second = at + 4 <= bytes.size() ? unit(at + 2) : 0;
    if (first >= 0xdc00 || second < 0xdc00 || second >= 0xe000) {
      damaged(at);
    }
    append(text, 0x10000 + ((first & 0x3ff) << 10 | (second & 0x3ff)));
    at += 2;
  }
  return text;
}

}  // namespace

std::string to_utf8(const std::filesystem::path& path, std::string bytes) {
  const std::string_view text = bytes;
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    bytes = from_utf16(path, text.substr(2), text.starts_with("\xfe\xff"));
  } else if (text.starts_with("\xef\xbb\xbf")) {
    bytes.erase(0, 3);
  } else if (!is_utf8(text)) {
    bytes = from_windows_1252(text);
  }
  if (bytes.find('\0') != std::string::npos) {
    throw InputError(
        fmt::format("{}: holds binary data, or text in an encoding without a byte order mark, which no table of labels "
                    "can be: save it as UTF-8",
                    path.string()));
  }
  return bytes;
}

}  // namespace tunica::volume_format
