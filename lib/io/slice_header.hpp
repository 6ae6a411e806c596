#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

/// What TIFF and PNG files say about their pages, read before an image library decodes them. Internal to lib/io.
namespace tunica::volume_format {

struct SliceHeader {
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  unsigned bits = 0;  ///< per pixel: 8, 16, 32 or 64
  enum class Kind { natural, integer, real } kind = Kind::natural;

  friend bool operator==(const SliceHeader&, const SliceHeader&) = default;
};

/// Every page of a TIFF file (classic or BigTIFF), in the order of the file. Checks that each page has one value per
/// pixel of a type that OpenCV 4.6 decodes to the bit (not unsigned 32), a lossless compression, pixels the file's
/// bytes can hold, and that no strip lies beyond the end of the file. Errors: InputError naming the file.
std::vector<SliceHeader> read_tiff_headers(const std::filesystem::path& path);

/// The header of a PNG file. Checks grey values of 8 or 16 bits, and that the file ends with the end chunk and can hold
/// its pixels. Errors: InputError naming the file.
SliceHeader read_png_header(const std::filesystem::path& path);

/// The PNG file without its ancillary chunks (colour profiles, texts), checked to decode: every checksum, the
/// compressed stream to its end, the filter of every row. Errors: InputError naming the file.
std::vector<unsigned char> read_png_pixels(const std::filesystem::path& path);

}  // namespace tunica::volume_format
