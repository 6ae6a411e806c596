#include "tunica/io/result/detail/hdf5_chunks.hpp"

#include "tunica/core/narrow.hpp"

#include <hdf5.h>
#include <zlib.h>

#include <array>
#include <limits>
#include <optional>

namespace tunica::hdf5 {
namespace {

constexpr double largest_chunk = std::numeric_limits<std::uint32_t>::max();  // bytes: of the format

/// Whether `deflated` inflates to `bytes`.
bool inflates_to(std::vector<unsigned char>& deflated, std::size_t bytes) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) {
    return false;
  }
  stream.next_in = deflated.data();
  stream.avail_in = narrow<uInt>(deflated.size());
  std::array<unsigned char, 1 << 16> some{};
  int code = Z_OK;
  std::size_t got = 0;
  while (code == Z_OK && got <= bytes) {
    stream.next_out = some.data();
    stream.avail_out = narrow<uInt>(some.size());
    code = inflate(&stream, Z_NO_FLUSH);
    got += some.size() - stream.avail_out;
  }
  inflateEnd(&stream);
  return code == Z_STREAM_END && got == bytes;
}

/// The bit of deflate in the mask of filters that a chunk skipped, 0 where no chunk is deflated; none where chunks go
/// through other filters than tunica's, or not all through the same.
std::optional<unsigned> deflate_bit(const Handle& creation) {
  unsigned options = 0;
  if (H5Pget_chunk_opts(creation.get(), &options) < 0 || options != 0) {
    return std::nullopt;
  }
  unsigned bit = 0;
  for (int k = 0; k < H5Pget_nfilters(creation.get()); ++k) {
    std::size_t values = 0;
    unsigned flags = 0, config = 0;
    const H5Z_filter_t filter =
        H5Pget_filter2(creation.get(), narrow<unsigned>(k), &flags, &values, nullptr, 0, nullptr, &config);
    if (filter == H5Z_FILTER_DEFLATE && bit == 0) {
      bit = 1U << narrow<unsigned>(k);
    } else if (filter != H5Z_FILTER_SHUFFLE) {
      return std::nullopt;
    }
  }
  return bit;
}

/// Whether the chunk at `at` is stored in, or inflates to, `bytes`. Its size is that of the same search by which HDF5
/// reads it: a damaged index may hold two chunks at one place, of which a list of all chunks shows the other.
bool is_whole(const Handle& data, const std::vector<Size>& at, unsigned deflate, std::size_t bytes) {
  Size stored = 0;
  if (H5Dget_chunk_storage_size(data.get(), at.data(), &stored) < 0 || stored == 0) {
    return true;  // HDF5 finds none: it takes the fill value, or fails
  }
  if (stored > compressBound(bytes)) {
    return false;
  }
  std::uint32_t skipped = 0;
  std::vector<unsigned char> chunk(stored);
  if (H5Dread_chunk(data.get(), H5P_DEFAULT, at.data(), &skipped, chunk.data()) < 0) {
    return false;
  }
  return (deflate & ~skipped) == 0 ? stored >= bytes : inflates_to(chunk, bytes);
}

}  // namespace

bool chunks_are_whole(const Handle& data, const std::vector<Size>& start, const std::vector<Size>& extent) {
  const Handle creation(H5Dget_create_plist(data.get()));
  if (H5Pget_layout(creation.get()) != H5D_CHUNKED) {
    return true;
  }
  if (H5Pget_nfilters(creation.get()) == 0) {
    return true;  // read from the file, whatever the index says of their length: see opened_for_reading()
  }
  const std::optional<unsigned> deflate = deflate_bit(creation);
  const Handle type(H5Dget_type(data.get()));
  const std::size_t rank = start.size();
  std::vector<Size> size(rank), at(rank);
  if (rank == 0 || !deflate || H5Pget_chunk(creation.get(), narrow<int>(rank), size.data()) != narrow<int>(rank)) {
    return false;
  }
  double bytes = real(H5Tget_size(type.get()));
  for (std::size_t k = 0; k < rank; ++k) {
    bytes *= real(size[k]);
    if (size[k] == 0 || bytes > largest_chunk) {
      return false;
    }
    at[k] = start[k] / size[k] * size[k];
  }
  for (std::size_t k = 0; k < rank;) {
    if (!is_whole(data, at, *deflate, static_cast<std::size_t>(bytes))) {
      return false;
    }
    for (k = 0; k < rank; ++k) {
      at[k] += size[k];
      if (at[k] < start[k] + extent[k]) {
        break;
      }
      at[k] = start[k] / size[k] * size[k];
    }
  }
  return true;
}

}  // namespace tunica::hdf5
