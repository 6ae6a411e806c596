#pragma once

#include "tunica/io/volume/detail/volume_format.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

/// TIFF and PNG files, decoded page by page by libtiff and libpng. Internal to lib/io.
namespace tunica::volume_format {

struct SliceHeader {
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  VoxelType type = VoxelType::uint8;

  [[nodiscard]] std::uint64_t row_bytes() const { return width * size_of(type); }

  friend bool operator==(const SliceHeader&, const SliceHeader&) = default;
};

/// A file of pages, read once from the first to the last. Whatever its library complains of while it decodes refuses
/// the file, and nothing of what the library says is printed.
class SliceFile {
public:
  SliceFile() = default;
  virtual ~SliceFile() = default;
  SliceFile(const SliceFile&) = delete;
  SliceFile& operator=(const SliceFile&) = delete;

  /// "TIFF" or "PNG".
  [[nodiscard]] virtual const char* format() const = 0;

  /// Goes to the next page. @return its header, none after the last page.
  /// Errors: InputError naming file and page: damaged, not one grey value per pixel, compressed with losses, or more
  /// pixels than the bytes of the file can hold.
  virtual std::optional<SliceHeader> next() = 0;

  /// Decodes that page to row_bytes() * height bytes, in the machine's byte order.
  /// Errors: InputError naming file and page: a strip, tile or row is truncated or damaged.
  virtual void decode(char* to) = 0;
};

/// Errors: InputError naming the file: it cannot be read, or is neither TIFF nor PNG.
std::unique_ptr<SliceFile> open_slices(const std::filesystem::path& path);

/// As open_slices(), of a file that looks like the one or the other.
std::unique_ptr<SliceFile> open_tiff(const std::filesystem::path& path);
std::unique_ptr<SliceFile> open_png(const std::filesystem::path& path);

}  // namespace tunica::volume_format
