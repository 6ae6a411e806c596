#include "tunica/io/file/signed_file.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/json.hpp"
#include "tunica/core/narrow.hpp"

#include <zlib.h>

#include <cstdint>

namespace tunica {
namespace {

std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes += static_cast<char>(static_cast<unsigned char>(value >> shift));
  }
  return bytes;
}

}  // namespace

std::string as_utf8(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

std::string png_made_by(const std::string& png, const std::string& made_by) {
  constexpr std::size_t behind_header = 8 + 4 + 4 + 13 + 4;  // the signature and the chunk IHDR
  TUNICA_ASSERT(png.size() > behind_header && png.compare(12, 4, "IHDR") == 0);
  // Keyword, then: not compressed, no language, no translated keyword.
  const std::string chunk = std::string("iTXtComment\0\0\0\0\0", 16) + as_utf8(made_by);
  const uLong sum = ::crc32(0, reinterpret_cast<const Bytef*>(chunk.data()), narrow<uInt>(chunk.size()));
  return png.substr(0, behind_header) + big_endian(narrow<std::uint32_t>(chunk.size() - 4)) + chunk +
         big_endian(narrow<std::uint32_t>(sum)) + png.substr(behind_header);
}

std::string xml_escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string xml_made_by(const std::string& made_by) {
  std::string text = as_utf8(made_by);
  for (std::size_t at = text.find("--"); at != std::string::npos; at = text.find("--", at)) {
    text.insert(at + 1, " ");
  }
  for (char& c : text) {
    c = static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  return "<!-- made by " + text + " -->\n";
}

}  // namespace tunica
