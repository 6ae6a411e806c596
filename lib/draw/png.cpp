#include "tunica/draw/detail/png.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <png.h>

namespace tunica {

std::string png_of(const std::vector<unsigned char>& pixels, int width, int height) {
  TUNICA_ASSERT(pixels.size() == narrow<std::size_t>(width) * narrow<std::size_t>(height) * 4);
  png_image header{};
  header.version = PNG_IMAGE_VERSION;
  header.width = narrow<png_uint_32>(width);
  header.height = narrow<png_uint_32>(height);
  header.format = PNG_FORMAT_RGBA;
  std::string bytes(PNG_IMAGE_PNG_SIZE_MAX(header), '\0');
  png_alloc_size_t size = bytes.size();
  TUNICA_ASSERT(png_image_write_to_memory(&header, bytes.data(), &size, 0, pixels.data(), 0, nullptr) != 0);
  bytes.resize(size);
  return bytes;
}

}  // namespace tunica
