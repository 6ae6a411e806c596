// TIFF 6.0 (Adobe, 1992), BigTIFF (https://www.awaresystems.be/imaging/tiff/bigtiff.html), PNG (RFC 2083)

#include "io/slice_header.hpp"

#include "core/error.hpp"
#include "core/progress.hpp"
#include "io/volume_format.hpp"

#include <zlib.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <set>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void throw_truncated(const fs::path& path, std::uint64_t missing) {
  throw InputError(
      fmt::format("{}: truncated: at least {} bytes are missing; get the whole file again", path.string(), missing));
}

// A file read at any place, its bytes in either order.
class RandomFile {
public:
  explicit RandomFile(const fs::path& path) : path_(path), file_(std::fopen(path.c_str(), "rb"), &std::fclose) {
    std::error_code error;
    if (!fs::is_regular_file(path, error) || !file_) {
      throw InputError(fmt::format("{}: cannot be read", path.string()));
    }
    size_ = fs::file_size(path);
  }

  void read(std::uint64_t offset, void* to, std::size_t count) {
    if (offset > size_ || count > size_ - offset) {
      throw_truncated(path_, offset > size_ ? offset - size_ + count : count - (size_ - offset));
    }
    if (::fseeko(file_.get(), static_cast<off_t>(offset), SEEK_SET) != 0 ||
        std::fread(to, 1, count, file_.get()) != count) {
      throw InputError(fmt::format("{}: cannot be read", path_.string()));
    }
  }

  [[nodiscard]] std::uint64_t size() const { return size_; }

private:
  fs::path path_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::uint64_t size_ = 0;
};

std::uint64_t number(const unsigned char* bytes, std::size_t count, bool big_endian) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value = value << 8 | bytes[big_endian ? i : count - 1 - i];
  }
  return value;
}

class TiffReader {
public:
  explicit TiffReader(const fs::path& path) : path_(path), file_(path) {
    std::array<unsigned char, 16> head{};
    file_.read(0, head.data(), 8);
    big_endian_ = head[0] == 'M';
    big_tiff_ = number(head.data() + 2, 2, big_endian_) == 43;
    if (big_tiff_) {
      file_.read(0, head.data(), 16);
      next_ = number(head.data() + 8, 8, big_endian_);
    } else {
      next_ = number(head.data() + 4, 4, big_endian_);
    }
  }

  std::vector<SliceHeader> pages() {
    std::vector<SliceHeader> result;
    std::set<std::uint64_t> seen;
    while (next_ != 0) {
      check_interrupt();
      if (!seen.insert(next_).second) {
        throw_corrupt("its pages form a ring");
      }
      read_directory();
      result.push_back(page(result.size()));
    }
    if (result.empty()) {
      throw_corrupt("it has no page");
    }
    require_no_hidden_pages(result.size());
    return result;
  }

private:
  enum Tag : std::uint64_t {
    width = 256,
    height = 257,
    bits_per_sample = 258,
    compression = 259,
    photometric = 262,
    description = 270,
    strip_offsets = 273,
    orientation = 274,
    samples_per_pixel = 277,
    strip_bytes = 279,
    tile_offsets = 324,
    tile_bytes = 325,
    sample_format = 339
  };

  struct Entry {
    std::uint64_t type = 0;
    std::uint64_t count = 0;
    std::uint64_t offset = 0;  // of the values in the file
  };

  [[noreturn]] void throw_corrupt(const std::string& what) const {
    throw InputError(fmt::format("{}: {}: the TIFF file is corrupt; get it again", path_.string(), what));
  }

  // Directories and tables that together are larger than the file overlap: a file made to waste time.
  void spend(std::uint64_t bytes) {
    spent_ += bytes;
    if (spent_ > 2 * file_.size()) {
      throw_corrupt("its tables are larger than the file");
    }
  }

  void read_directory() {
    std::array<unsigned char, 20> bytes{};
    const std::size_t count_size = big_tiff_ ? 8 : 2;
    const std::size_t entry_size = big_tiff_ ? 20 : 12;
    const std::size_t word = big_tiff_ ? 8 : 4;
    file_.read(next_, bytes.data(), count_size);
    const std::uint64_t count = number(bytes.data(), count_size, big_endian_);
    if (count > 4096) {
      throw_corrupt(fmt::format("a page has {} tags", count));
    }
    entries_.clear();
    std::uint64_t at = next_ + count_size;
    for (std::uint64_t i = 0; i < count; ++i, at += entry_size) {
      file_.read(at, bytes.data(), entry_size);
      Entry entry;
      entry.type = number(bytes.data() + 2, 2, big_endian_);
      entry.count = number(bytes.data() + 4, word, big_endian_);
      const std::uint64_t value_size = size_of_type(entry.type);
      const std::size_t value_at = 4 + word;
      const bool inside = value_size > 0 && entry.count <= word / value_size;
      entry.offset = inside ? at + value_at : number(bytes.data() + value_at, word, big_endian_);
      if (!inside && value_size > 0 &&
          (entry.offset > file_.size() || entry.count > (file_.size() - entry.offset) / value_size)) {
        throw_corrupt("the value of a tag lies beyond the file's end: it is truncated");
      }
      entries_[number(bytes.data(), 2, big_endian_)] = entry;
    }
    file_.read(at, bytes.data(), word);
    next_ = number(bytes.data(), word, big_endian_);
    spend(count_size + count * entry_size);
  }

  static std::uint64_t size_of_type(std::uint64_t type) {
    constexpr std::array<std::uint64_t, 19> sizes{0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8};
    return type < sizes.size() ? sizes[type] : 0;
  }

  std::vector<std::uint64_t> values(Tag tag) {
    const auto at = entries_.find(tag);
    if (at == entries_.end()) {
      return {};
    }
    const Entry& entry = at->second;
    const std::uint64_t size = size_of_type(entry.type);
    if (size == 0 || entry.count > file_.size() / size) {
      throw_corrupt(fmt::format("tag {} is damaged", static_cast<std::uint64_t>(tag)));
    }
    if (size * entry.count > 8) {
      spend(size * entry.count);
    }
    std::vector<unsigned char> bytes(size * entry.count);
    file_.read(entry.offset, bytes.data(), bytes.size());
    std::vector<std::uint64_t> result(entry.count);
    for (std::uint64_t i = 0; i < entry.count; ++i) {
      result[i] = number(bytes.data() + i * size, size, big_endian_);
    }
    return result;
  }

  std::uint64_t value(Tag tag, std::uint64_t otherwise) {
    const auto all = values(tag);
    return all.empty() ? otherwise : all.front();
  }

  SliceHeader page(std::size_t index) {
    const auto refuse = [&](const std::string& what) {
      throw InputError(fmt::format("{}: page {} {}", path_.string(), index, what));
    };
    SliceHeader header;
    header.width = value(width, 0);
    header.height = value(height, 0);
    if (header.width == 0 || header.height == 0 || header.width > 0x7fffffff || header.height > 0x7fffffff) {
      throw_corrupt(fmt::format("page {} has {} x {} pixels", index, header.width, header.height));
    }
    const std::uint64_t samples = value(samples_per_pixel, 1);
    const std::uint64_t colours = value(photometric, 1);
    if (samples != 1 || colours > 1) {
      refuse(fmt::format("has colours ({} values per pixel, photometric {}): save one grey value per pixel", samples,
                         colours));
    }
    if (colours == 0) {
      refuse("is stored with white as 0 (inverted): save it with black as 0");
    }
    if (const std::uint64_t turned = value(orientation, 1); turned != 1) {
      refuse(fmt::format("is stored turned (orientation {}): save it with the first row on top", turned));
    }
    const std::uint64_t bits = value(bits_per_sample, 1);
    const std::uint64_t format = value(sample_format, 1);
    const bool real = format == 3;
    if ((bits != 8 && bits != 16 && bits != 32 && bits != 64) || format < 1 || format > 3 || (real && bits < 32) ||
        (!real && bits > 32) || (format == 1 && bits == 32)) {
      refuse(
          fmt::format("has pixels of {} bits (sample format {}): save integers of 8 or 16 bits, signed ones of "
                      "32 bits, or floats of 32 or 64 bits",
                      bits, format));
    }
    header.bits = static_cast<unsigned>(bits);
    header.kind = real          ? SliceHeader::Kind::real
                  : format == 2 ? SliceHeader::Kind::integer
                                : SliceHeader::Kind::natural;
    require_pixels(header, index);
    return header;
  }

  void require_pixels(const SliceHeader& header, std::size_t index) {
    const bool tiled = entries_.contains(tile_offsets);
    const auto offsets = values(tiled ? tile_offsets : strip_offsets);
    const auto sizes = values(tiled ? tile_bytes : strip_bytes);
    if (offsets.empty() || offsets.size() != sizes.size()) {
      throw_corrupt(fmt::format("page {} does not say where its pixels are", index));
    }
    std::uint64_t stored = 0;
    for (std::size_t i = 0; i < offsets.size(); ++i) {
      if (sizes[i] > file_.size() || offsets[i] > file_.size() - sizes[i]) {
        throw_truncated(path_,
                        sizes[i] > file_.size() ? sizes[i] - file_.size() : offsets[i] + sizes[i] - file_.size());
      }
      stored += sizes[i];
    }
    const std::uint64_t wanted = header.width * header.height * (header.bits / 8);
    // The most bytes that one byte can become: deflate 1032, LZW some 2900, PackBits 64.
    std::uint64_t expansion = 1;
    switch (value(compression, 1)) {
      case 1:
        break;
      case 5:
        expansion = 4096;
        break;
      case 8:
      case 32946:
        expansion = 1032;
        break;
      case 32773:
        expansion = 64;
        break;
      default:
        throw InputError(
            fmt::format("{}: page {} is compressed by method {}: save it uncompressed or with LZW, deflate "
                        "or PackBits",
                        path_.string(), index, value(compression, 1)));
    }
    if (wanted / expansion > stored) {
      throw InputError(
          fmt::format("{}: truncated: page {} has {} x {} pixels, and at least {} bytes of them are missing",
                      path_.string(), index, header.width, header.height, wanted / expansion - stored));
    }
  }

  // ImageJ writes stacks over 4 GiB as one page and says so in its description.
  void require_no_hidden_pages(std::size_t pages) {
    const auto at = entries_.find(description);
    if (pages != 1 || at == entries_.end() || at->second.count > 65536) {
      return;
    }
    std::string text;
    for (const std::uint64_t c : values(description)) {
      text += static_cast<char>(c);
    }
    const std::size_t images = text.find("images=");
    if (text.starts_with("ImageJ=") && images != std::string::npos) {
      const auto count = parse_count(std::string_view(text).substr(images + 7, text.find('\n', images) - images - 7));
      if (count && *count > 1) {
        throw InputError(
            fmt::format("{}: holds {} slices, of which ImageJ declared only the first as a page: save them "
                        "as a folder of slices or as NIfTI",
                        path_.string(), *count));
      }
    }
  }

  fs::path path_;
  RandomFile file_;
  bool big_endian_ = false;
  bool big_tiff_ = false;
  std::uint64_t next_ = 0;
  std::uint64_t spent_ = 0;
  std::map<std::uint64_t, Entry> entries_;
};

constexpr std::size_t png_signature = 8;

// Walks over the chunks of a PNG file: use(type, offset of its data, length), up to and with IEND.
template <class Use>
void for_each_chunk(RandomFile& file, const fs::path& path, Use use) {
  std::uint64_t at = png_signature;
  for (std::string type; type != "IEND";) {
    check_interrupt();
    std::array<unsigned char, 8> head{};
    file.read(at, head.data(), head.size());
    const std::uint64_t length = number(head.data(), 4, true);
    type.assign(reinterpret_cast<const char*>(head.data()) + 4, 4);
    if (at + 12 + length > file.size()) {
      throw_truncated(path, at + 12 + length - file.size());
    }
    if ((at == png_signature) != (type == "IHDR") || (type == "IHDR" && length != 13)) {
      throw InputError(fmt::format("{}: its PNG header is not where it belongs: the file is corrupt", path.string()));
    }
    use(type, at + 8, length);
    at += 12 + length;
  }
}

struct Rows {
  std::uint64_t count = 0;
  std::uint64_t bytes = 0;  // of each, with the filter's byte in front
};

// The rows in the order of the stream; an interlaced picture (Adam7) has seven sets of them.
std::vector<Rows> rows_of(const SliceHeader& header, bool interlaced) {
  const std::uint64_t pixel = header.bits / 8;
  if (!interlaced) {
    return {{header.height, 1 + header.width * pixel}};
  }
  constexpr std::array<std::array<std::uint64_t, 4>, 7> passes{
      {{0, 8, 0, 8}, {4, 8, 0, 8}, {0, 4, 4, 8}, {2, 4, 0, 4}, {0, 2, 2, 4}, {1, 2, 0, 2}, {0, 1, 1, 2}}};
  std::vector<Rows> rows;
  for (const auto& [x, dx, y, dy] : passes) {
    const std::uint64_t columns = header.width > x ? (header.width - x + dx - 1) / dx : 0;
    const std::uint64_t lines = header.height > y ? (header.height - y + dy - 1) / dy : 0;
    if (columns > 0 && lines > 0) {
      rows.push_back({lines, 1 + columns * pixel});
    }
  }
  return rows;
}

// Inflates the pixels and drops them, to see that they are all there and every row has a filter that exists.
void require_rows(const fs::path& path, std::vector<unsigned char>& stored, const std::vector<Rows>& rows) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) {
    throw std::bad_alloc();
  }
  const std::unique_ptr<z_stream, int (*)(z_streamp)> guard(&stream, &inflateEnd);
  std::uint64_t total = 0;
  for (const Rows& set : rows) {
    total += set.count * set.bytes;
  }
  std::vector<unsigned char> buffer(std::size_t{1} << 18);
  std::size_t fed = 0;
  std::uint64_t done = 0;
  std::uint64_t next_filter = 0;
  std::size_t set = 0;
  std::uint64_t row = 0;
  while (done < total) {
    check_interrupt();
    if (stream.avail_in == 0) {
      stream.next_in = stored.data() + fed;
      stream.avail_in = static_cast<uInt>(std::min<std::size_t>(stored.size() - fed, std::size_t{1} << 30));
      fed += stream.avail_in;
    }
    stream.next_out = buffer.data();
    stream.avail_out = static_cast<uInt>(std::min<std::uint64_t>(buffer.size(), total - done));
    const uInt wanted = stream.avail_out;
    const int code = inflate(&stream, Z_NO_FLUSH);
    const uInt got = wanted - stream.avail_out;
    while (next_filter < done + got) {
      if (buffer[next_filter - done] > 4) {
        throw InputError(
            fmt::format("{}: the filter of a row of its pixels does not exist: the PNG file is corrupt; get "
                        "it again",
                        path.string()));
      }
      next_filter += rows[set].bytes;
      if (++row == rows[set].count) {
        ++set;
        row = 0;
      }
    }
    done += got;
    if (done == total) {
      return;
    }
    if (code == Z_STREAM_END || (code == Z_BUF_ERROR && fed == stored.size())) {
      throw InputError(
          fmt::format("{}: truncated: {} of the {} bytes of its pixels are missing; get the whole file again",
                      path.string(), total - done, total));
    }
    if (code != Z_OK && code != Z_BUF_ERROR) {
      throw InputError(
          fmt::format("{}: its compressed pixels are corrupt after {} bytes; get the file again", path.string(), done));
    }
  }
}

SliceHeader parse_png_header(const fs::path& path, const std::array<unsigned char, 13>& bytes) {
  SliceHeader header;
  header.width = number(bytes.data(), 4, true);
  header.height = number(bytes.data() + 4, 4, true);
  header.bits = bytes[8];
  const unsigned colour = bytes[9];
  if (colour != 0) {
    throw InputError(
        fmt::format("{}: has colours (PNG colour type {}): save one grey value per pixel", path.string(), colour));
  }
  if (header.bits != 8 && header.bits != 16) {
    throw InputError(fmt::format("{}: has grey values of {} bits: save 8 or 16", path.string(), header.bits));
  }
  if (header.width == 0 || header.height == 0 || header.width > 0x7fffffff || header.height > 0x7fffffff ||
      bytes[10] != 0 || bytes[11] != 0 || bytes[12] > 1) {
    throw InputError(fmt::format("{}: its PNG header ({} x {} pixels) is corrupt; get the file again", path.string(),
                                 header.width, header.height));
  }
  return header;
}

}  // namespace

bool looks_like_tiff(std::string_view head) {
  return head.starts_with(std::string_view("II*\0", 4)) || head.starts_with(std::string_view("MM\0*", 4)) ||
         head.starts_with(std::string_view("II+\0", 4)) || head.starts_with(std::string_view("MM\0+", 4));
}

bool looks_like_png(std::string_view head) { return head.starts_with("\x89PNG\r\n\x1a\n"); }

std::vector<SliceHeader> read_tiff_headers(const fs::path& path) { return TiffReader(path).pages(); }

SliceHeader read_png_header(const fs::path& path) {
  RandomFile file(path);
  std::uint64_t stored = 0;
  SliceHeader header;
  for_each_chunk(file, path, [&](const std::string& type, std::uint64_t offset, std::uint64_t length) {
    if (type == "IHDR") {
      std::array<unsigned char, 13> bytes{};
      file.read(offset, bytes.data(), bytes.size());
      header = parse_png_header(path, bytes);
    } else if (type == "IDAT") {
      stored += length;
    } else if (type == "tRNS") {
      throw InputError(fmt::format("{}: has a transparent grey value: save it without", path.string()));
    }
  });
  const std::uint64_t wanted = header.width * header.height * (header.bits / 8);
  if (wanted / 1032 > stored) {
    throw InputError(fmt::format("{}: truncated: {} x {} pixels, and at least {} bytes of them are missing",
                                 path.string(), header.width, header.height, wanted / 1032 - stored));
  }
  return header;
}

std::vector<unsigned char> read_png_pixels(const fs::path& path) {
  RandomFile file(path);
  std::vector<unsigned char> result(png_signature);
  file.read(0, result.data(), result.size());
  std::vector<unsigned char> pixels;
  SliceHeader header;
  bool interlaced = false;
  for_each_chunk(file, path, [&](const std::string& type, std::uint64_t offset, std::uint64_t length) {
    if (type != "IHDR" && type != "IDAT" && type != "IEND") {
      return;
    }
    const std::size_t begin = result.size();
    result.resize(begin + length + 12);
    unsigned char* chunk = result.data() + begin;  // length, type, data, checksum
    file.read(offset - 8, chunk, length + 12);
    if (crc32(0, chunk + 4, static_cast<uInt>(length + 4)) != number(chunk + 8 + length, 4, true)) {
      throw InputError(
          fmt::format("{}: its PNG chunk at byte {} has a wrong checksum: the file is corrupt; get it again",
                      path.string(), offset - 8));
    }
    if (type == "IHDR") {
      std::array<unsigned char, 13> bytes{};
      std::copy_n(chunk + 8, bytes.size(), bytes.begin());
      header = parse_png_header(path, bytes);
      interlaced = bytes[12] == 1;
    } else {
      pixels.insert(pixels.end(), chunk + 8, chunk + 8 + length);
    }
  });
  require_rows(path, pixels, rows_of(header, interlaced));
  return result;
}

}  // namespace tunica::volume_format
