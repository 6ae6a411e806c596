#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/io/file/output_file.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

/// The bytes behind a volume's header. Internal to lib/io.
namespace tunica::volume_format {

/// What readers hold at once of a file that may be larger than memory.
inline constexpr std::size_t buffer_bytes = std::size_t{1} << 18;

enum class Coding { plain, deflated };  ///< deflated: a gzip or zlib stream

/// Deflated when the file begins with gzip's magic number. Errors: InputError: missing, not a regular file.
Coding coding_of(const std::filesystem::path& path);

/// The bytes of a regular file from an offset on, inflated on the way when they are deflated. It never holds more than
/// a small buffer, and never inflates more than it is asked for.
class ByteStream {
public:
  /// Errors: InputError: missing, not a regular file, unreadable, shorter than `offset`.
  ByteStream(const std::filesystem::path& path, std::uint64_t offset, Coding coding);
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  /// @return the bytes read, fewer than `size` only at the end. Errors: InputError: corrupt deflate data.
  std::size_t read(void* to, std::size_t size);
  /// As read(), dropping the bytes.
  std::uint64_t skip(std::uint64_t size);

  /// Called after the last voxel: checks that a compressed stream is whole, and warns of bytes that follow.
  void finish(std::vector<Warning>& warnings);

  /// Bytes delivered or skipped so far.
  [[nodiscard]] std::uint64_t position() const { return position_; }
  /// The most bytes that can be in the stream from its beginning on: what deflate can make of the file at the best.
  [[nodiscard]] std::uint64_t most_bytes() const { return most_bytes_; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

private:
  struct Inflater;
  std::size_t read_plain(void* to, std::size_t size);
  std::size_t read_deflated(void* to, std::size_t size);

  std::filesystem::path path_;
  OpenFile file_;
  std::unique_ptr<Inflater> inflater_;
  std::uint64_t position_ = 0;
  std::uint64_t most_bytes_ = 0;
};

}  // namespace tunica::volume_format
