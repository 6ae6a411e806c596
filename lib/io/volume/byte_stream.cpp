#include "tunica/io/volume/detail/byte_stream.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/encoding.hpp"

#include <zlib.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

namespace tunica::volume_format {
namespace fs = std::filesystem;

Coding coding_of(const fs::path& path) {
  std::array<unsigned char, 2> magic{};
  ByteStream(path, 0, Coding::plain).read(magic.data(), magic.size());
  return magic[0] == 0x1f && magic[1] == 0x8b ? Coding::deflated : Coding::plain;
}

struct ByteStream::Inflater {
  z_stream stream{};
  std::vector<unsigned char> buffer;
  bool ended = false;
  bool cut_off = false;  // the file ended inside the stream

  explicit Inflater(std::size_t buffer_size) : buffer(buffer_size) {
    // 15 bits of window, and 32: gzip or zlib, told by the header.
    if (inflateInit2(&stream, 15 + 32) != Z_OK) {
      throw std::bad_alloc();
    }
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

ByteStream::ByteStream(const fs::path& path, std::uint64_t offset, Coding coding)
    : path_(path), file_(open_input(path)) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) {
    throw InputError(fmt::format("{}: cannot be read: {}", path.string(), error.message()));
  }
  if (offset > size) {
    throw InputError(
        fmt::format("{}: truncated: its voxels begin at byte {}, and it ends {} bytes before that; get the "
                    "whole file again",
                    path.string(), offset, offset - size));
  }
  if (::fseeko(file_.get(), narrow<off_t>(offset), SEEK_SET) != 0) {
    throw InputError(fmt::format("{}: cannot be read: {}", path.string(), std::strerror(errno)));
  }
  most_bytes_ = size - offset;
  if (coding == Coding::deflated) {
    inflater_ = std::make_unique<Inflater>(std::min<std::uint64_t>(most_bytes_, buffer_bytes));
    most_bytes_ *= deflate_expansion;
  }
}

ByteStream::~ByteStream() = default;

std::size_t ByteStream::read(void* to, std::size_t size) {
  const std::size_t got = inflater_ ? read_deflated(to, size) : read_plain(to, size);
  position_ += got;
  return got;
}

std::size_t ByteStream::read_plain(void* to, std::size_t size) {
  const std::size_t got = std::fread(to, 1, size, file_.get());
  if (got < size && std::ferror(file_.get()) != 0) {
    throw InputError(fmt::format("{}: cannot be read: {}", path_.string(), std::strerror(errno)));
  }
  return got;
}

std::size_t ByteStream::read_deflated(void* to, std::size_t size) {
  z_stream& stream = inflater_->stream;
  auto* out = static_cast<Bytef*>(to);
  std::size_t got = 0;
  while (got < size && !inflater_->ended) {
    if (stream.avail_in == 0) {
      stream.avail_in = narrow<uInt>(read_plain(inflater_->buffer.data(), inflater_->buffer.size()));
      stream.next_in = inflater_->buffer.data();
      if (stream.avail_in == 0) {
        inflater_->ended = true;
        inflater_->cut_off = true;
        break;
      }
    }
    const auto now = narrow<uInt>(std::min<std::size_t>(size - got, std::size_t{1} << 30));
    stream.next_out = out + got;
    stream.avail_out = now;
    const int code = inflate(&stream, Z_NO_FLUSH);
    got += now - stream.avail_out;
    if (code == Z_STREAM_END) {
      // A gzip file may be several streams one after the other.
      const bool more = stream.avail_in >= 2 && stream.next_in[0] == 0x1f && stream.next_in[1] == 0x8b;
      inflater_->ended = !more || inflateReset(&stream) != Z_OK;
    } else if (code == Z_MEM_ERROR) {
      throw std::bad_alloc();
    } else if (code != Z_OK && code != Z_BUF_ERROR) {
      throw InputError(fmt::format("{}: its compressed data is corrupt after {} bytes ({}); get the file again",
                                   path_.string(), position_ + got, stream.msg != nullptr ? stream.msg : "zlib error"));
    }
  }
  return got;
}

std::uint64_t ByteStream::skip(std::uint64_t size) {
  if (!inflater_) {
    const std::uint64_t now = std::min(size, most_bytes_ - std::min(most_bytes_, position_));
    if (::fseeko(file_.get(), narrow<off_t>(now), SEEK_CUR) != 0) {
      throw InputError(fmt::format("{}: cannot be read: {}", path_.string(), std::strerror(errno)));
    }
    position_ += now;
    return now;
  }
  std::vector<char> buffer(std::min<std::uint64_t>(size, buffer_bytes));
  std::uint64_t done = 0;
  while (done < size) {
    check_interrupt();
    const std::size_t wanted = std::min<std::uint64_t>(size - done, buffer.size());
    const std::size_t got = read(buffer.data(), wanted);
    done += got;
    if (got < wanted) {
      break;
    }
  }
  return done;
}

void ByteStream::finish(std::vector<Warning>& warnings) {
  std::array<char, 4096> rest;
  const std::size_t count = read(rest.data(), rest.size());  // and so verifies the checksum at a gzip stream's end
  if (count > 0) {
    warnings.push_back(
        {Weight::minor, "bytes too many",
         fmt::format("{}: {}{} bytes follow the voxels and are ignored: the sizes in its header may be wrong",
                     path_.string(), count == rest.size() ? "at least " : "", count)});
  } else if (inflater_ && inflater_->cut_off) {
    throw InputError(
        fmt::format("{}: truncated: at least 1 byte is missing from the end of its compressed stream, after "
                    "the last voxel; get the whole file again",
                    path_.string()));
  } else if (inflater_ && (inflater_->stream.avail_in > 0 || std::fgetc(file_.get()) != EOF)) {
    warnings.push_back({Weight::minor, "bytes too many",
                        fmt::format("{}: bytes follow its compressed stream and are ignored", path_.string())});
  }
}

}  // namespace tunica::volume_format
