#include "fuzz/target.hpp"

#include <zlib.h>

#include <algorithm>

namespace tunica::fuzz {
namespace {

constexpr std::string_view png_mark = "\x89PNG\r\n\x1a\n";

// The same chunks with the checksums that belong to them: libpng looks no further behind a wrong one.
std::string with_checksums(std::string png) {
  std::size_t at = png_mark.size();
  while (at + 12 <= png.size()) {
    std::size_t length = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      length = length << 8 | static_cast<unsigned char>(png[at + k]);
    }
    if (length > png.size() - at - 12) {
      break;
    }
    const auto sum = ::crc32_z(0, reinterpret_cast<const Bytef*>(png.data() + at + 4), length + 4);
    for (std::size_t k = 0; k < 4; ++k) {
      png[at + 8 + length + k] = static_cast<char>(sum >> (24 - 8 * k) & 0xff);
    }
    at += length + 12;
  }
  return png;
}

}  // namespace
}  // namespace tunica::fuzz

// TIFF of several pages, alone and as a slice of a folder, and PNG as slices of a folder.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tunica::fuzz;
  const std::string bytes(text_of(data, size));
  std::error_code ignored;
  const std::filesystem::path slices = folder() / "slices";
  std::filesystem::remove_all(slices, ignored);
  std::filesystem::create_directory(slices);
  if (bytes.starts_with(png_mark)) {
    for (const std::string& png : {bytes, with_checksums(bytes)}) {
      file("slices/1.png", png);
      file("slices/2.png", png);
      volume_at(slices, true);
    }
  } else {
    volume_at(file("a.tif", bytes), true);
    file("slices/1.tif", bytes);
    volume_at(slices, true);
  }
  return 0;
}
