// TIFF 6.0 (Adobe, 1992) and BigTIFF by libtiff 4.5

#include "tunica/core/error.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/io/volume/detail/slice_file.hpp"

#include <tiffio.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstdarg>
#include <cstring>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

// The most bytes that one byte can become; none for a method that loses something or is not known.
std::optional<double> expansion_of(unsigned compression) {
  switch (compression) {
    case COMPRESSION_NONE:
      return 1;
    case COMPRESSION_LZW:  // the longest chain of its 4096 codes
      return 4096;
    case COMPRESSION_ADOBE_DEFLATE:
    case COMPRESSION_DEFLATE:
      return deflate_expansion;
    case COMPRESSION_PACKBITS:
      return 64;
    default:
      return {};
  }
}

std::optional<VoxelType> voxel_type(unsigned bits, unsigned format) {
  constexpr std::array types{VoxelType::uint8,   VoxelType::int8,   VoxelType::uint16, VoxelType::int16,
                             VoxelType::uint32,  VoxelType::int32,  VoxelType::uint64, VoxelType::int64,
                             VoxelType::float32, VoxelType::float64};
  for (const VoxelType type : types) {
    const bool real = type == VoxelType::float32 || type == VoxelType::float64;
    const bool natural = !real && name_of(type).starts_with('u');
    const unsigned its_format = real ? SAMPLEFORMAT_IEEEFP : natural ? SAMPLEFORMAT_UINT : SAMPLEFORMAT_INT;
    if (bits == 8 * size_of(type) && format == its_format) {
      return type;
    }
  }
  return {};
}

class TiffFile : public SliceFile {
public:
  explicit TiffFile(const fs::path& path) : path_(path), file_(open_input(path)), tiff_(nullptr, &TIFFClose) {
    std::error_code error;
    size_ = fs::file_size(path, error);
    if (error) {
      throw InputError(fmt::format("{}: cannot be read: {}", path.string(), error.message()));
    }
    budget_ = most_readings * size_;
    // What has no file to belong to would still be printed.
    TIFFSetErrorHandler(nullptr);
    TIFFSetWarningHandler(nullptr);
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                               &TIFFOpenOptionsFree);
    if (!options) {
      throw std::bad_alloc();
    }
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), &complain, this);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), &complain, this);
    // Tables of two bytes an entry are held as eight.
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), static_cast<tmsize_t>((std::uint64_t{1} << 20) + 4 * size_));
    // m: no memory map, which a file cut while it is read would turn into a crash; c: strips as the file has them.
    tiff_.reset(TIFFClientOpenExt(path.c_str(), "rmc", this, &read, &write, &seek, &close, &size, nullptr, nullptr,
                                  options.get()));
    if (!tiff_) {
      throw InputError(fmt::format(
          "{}: the TIFF file has no page that can be read: it is truncated or corrupt; get it again", path.string()));
    }
  }

  [[nodiscard]] const char* format() const override { return "TIFF"; }

  std::optional<SliceHeader> next() override {
    check_interrupt();
    if (page_ && !cut_ && TIFFLastDirectory(tiff_.get()) != 0) {
      return {};
    }
    // A link to the next page that lies beyond the file's end is not followed, without a word.
    if (page_ && (cut_ || TIFFReadDirectory(tiff_.get()) != 1)) {
      throw InputError(
          fmt::format("{}: page {} and what follows cannot be read: the TIFF file is truncated or "
                      "corrupt; get it again",
                      path_.string(), *page_ + 1));
    }
    page_ = page_ ? *page_ + 1 : 0;
    header_ = checked_header();
    require_no_hidden_pages();
    return header_;
  }

  void decode(char* to) override {
    starts_.clear();
    const bool tiled = TIFFIsTiled(tiff_.get()) != 0;
    const std::uint32_t parts = tiled ? TIFFNumberOfTiles(tiff_.get()) : TIFFNumberOfStrips(tiff_.get());
    for (std::uint32_t part = 0; part < parts && !compressed_; ++part) {
      starts_.push_back(TIFFGetStrileOffset(tiff_.get(), part));
    }
    std::sort(starts_.begin(), starts_.end());
    if (tiled) {
      decode_tiles(to);
    } else {
      decode_strips(to);
    }
  }

private:
  // Once for its header, once for its pixels, once to spare. Tables and strips that lie on one another would have it
  // read without end.
  static constexpr std::uint64_t most_readings = 3;

  static TiffFile& self(thandle_t handle) { return *static_cast<TiffFile*>(handle); }

  static int complain(TIFF*, void* user, const char*, const char*, va_list) {
    self(user).complained_ = true;
    return 1;  // said
  }
  static tmsize_t read(thandle_t handle, void* to, tmsize_t count) {
    TiffFile& file = self(handle);
    const std::size_t got =
        std::fread(to, 1, std::min(static_cast<std::uint64_t>(count), file.budget_), file.file_.get());
    file.budget_ -= got;
    file.cut_ = file.cut_ || got < static_cast<std::uint64_t>(count);
    return static_cast<tmsize_t>(got);
  }
  static tmsize_t write(thandle_t, void*, tmsize_t) { return 0; }
  static toff_t seek(thandle_t handle, toff_t offset, int whence) {
    std::FILE* file = self(handle).file_.get();
    return ::fseeko(file, static_cast<off_t>(offset), whence) == 0 ? static_cast<toff_t>(::ftello(file))
                                                                   : static_cast<toff_t>(-1);
  }
  static int close(thandle_t) { return 0; }
  static toff_t size(thandle_t handle) { return self(handle).size_; }

  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(fmt::format("{}: page {} {}", path_.string(), *page_, what));
  }

  template <class T>
  [[nodiscard]] T value(ttag_t tag, T otherwise) const {
    T result = 0;
    return TIFFGetField(tiff_.get(), tag, &result) == 1 ? result : otherwise;
  }

  SliceHeader checked_header() {
    const auto width = value<std::uint32_t>(TIFFTAG_IMAGEWIDTH, 0);
    const auto height = value<std::uint32_t>(TIFFTAG_IMAGELENGTH, 0);
    if (width == 0 || height == 0) {
      refuse(fmt::format("has {} x {} pixels: the TIFF file is corrupt; get it again", width, height));
    }
    const auto samples = value<std::uint16_t>(TIFFTAG_SAMPLESPERPIXEL, 1);
    const auto colours = value<std::uint16_t>(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    if (samples != 1 || colours > PHOTOMETRIC_MINISBLACK) {
      refuse(fmt::format("has colours ({} values per pixel, photometric {}): save one grey value per pixel", samples,
                         colours));
    }
    if (colours == PHOTOMETRIC_MINISWHITE) {
      refuse("is stored with white as 0 (inverted): save it with black as 0");
    }
    const auto turned = value<std::uint16_t>(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
    if (turned != ORIENTATION_TOPLEFT) {
      refuse(fmt::format("is stored turned (orientation {}): save it with the first row on top", turned));
    }
    const auto bits = value<std::uint16_t>(TIFFTAG_BITSPERSAMPLE, 1);
    const auto format = value<std::uint16_t>(TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_UINT);
    const std::optional<VoxelType> type = voxel_type(bits, format);
    if (!type) {
      refuse(
          fmt::format("has pixels of {} bits (sample format {}): save integers of 8, 16, 32 or 64 bits, or floats "
                      "of 32 or 64 bits",
                      bits, format));
    }
    const auto compression = value<std::uint16_t>(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
    const std::optional<double> expansion = expansion_of(compression);
    if (!expansion) {
      refuse(fmt::format("is compressed by method {}: save it uncompressed or with LZW, deflate or PackBits",
                         compression));
    }
    const SliceHeader header{width, height, *type};
    compressed_ = compression != COMPRESSION_NONE;
    most_bytes_ = *expansion * static_cast<double>(size_);
    needed_ += static_cast<double>(size_of(*type)) * width * height / *expansion;
    if (needed_ > static_cast<double>(size_)) {
      refuse(fmt::format("has {} x {} pixels, more than the file's bytes can hold: it is truncated; get it again",
                         width, height));
    }
    return header;
  }

  // ImageJ writes stacks over 4 GiB as one page and says so in its description.
  void require_no_hidden_pages() const {
    const char* bytes = nullptr;
    if (page_ != 0 || TIFFLastDirectory(tiff_.get()) == 0 ||
        TIFFGetField(tiff_.get(), TIFFTAG_IMAGEDESCRIPTION, &bytes) != 1) {
      return;
    }
    const std::string_view text(bytes);
    const std::size_t images = text.find("images=");
    if (text.starts_with("ImageJ=") && images != std::string_view::npos) {
      const auto count = parse_count(text.substr(images + 7, text.find('\n', images) - images - 7));
      if (count && *count > 1) {
        throw InputError(
            fmt::format("{}: holds {} slices, of which ImageJ declared only the first as a page: save them "
                        "as a folder of slices or as NIfTI",
                        path_.string(), *count));
      }
    }
  }

  void require(const char* what, std::uint32_t index, tmsize_t got, std::uint64_t wanted) {
    // What is not compressed is read on behind the strip's end, into the next one where libtiff takes the byte counts
    // for wrong ones.
    const std::uint64_t start = TIFFGetStrileOffset(tiff_.get(), index);
    const auto next = std::upper_bound(starts_.begin(), starts_.end(), start);
    const bool too_short = !compressed_ && (TIFFGetStrileByteCount(tiff_.get(), index) < wanted ||
                                            (next != starts_.end() && *next - start < wanted));
    if (got < 0 || static_cast<std::uint64_t>(got) != wanted || too_short || complained_) {
      refuse(fmt::format("cannot be decoded: its {} {} is truncated or corrupt; get the file again", what, index));
    }
    check_interrupt();
  }

  void decode_strips(char* to) {
    const std::uint64_t rows =
        std::min<std::uint64_t>(value<std::uint32_t>(TIFFTAG_ROWSPERSTRIP, 0xffffffff), header_.height);
    complained_ = false;
    for (std::uint64_t row = 0; row < header_.height; row += rows) {
      const auto strip = static_cast<std::uint32_t>(row / rows);
      const std::uint64_t bytes = std::min(rows, header_.height - row) * header_.row_bytes();
      require("strip", strip, TIFFReadEncodedStrip(tiff_.get(), strip, to, static_cast<tmsize_t>(bytes)), bytes);
      to += bytes;
    }
  }

  void decode_tiles(char* to) {
    const std::uint64_t width = value<std::uint32_t>(TIFFTAG_TILEWIDTH, 0);
    const std::uint64_t height = value<std::uint32_t>(TIFFTAG_TILELENGTH, 0);
    const std::uint64_t bytes = TIFFTileSize64(tiff_.get());
    const std::size_t pixel = size_of(header_.type);
    if (bytes != width * height * pixel || bytes == 0 || static_cast<double>(bytes) > most_bytes_) {
      refuse(
          fmt::format("has tiles of {} x {} pixels, more than the file's bytes can hold: it is corrupt; get it again",
                      width, height));
    }
    std::vector<char> tile(bytes);
    complained_ = false;
    std::uint32_t index = 0;
    for (std::uint64_t y = 0; y < header_.height; y += height) {
      for (std::uint64_t x = 0; x < header_.width; x += width, ++index) {
        require("tile", index, TIFFReadEncodedTile(tiff_.get(), index, tile.data(), static_cast<tmsize_t>(bytes)),
                bytes);
        for (std::uint64_t row = 0; row < std::min(height, header_.height - y); ++row) {
          std::memcpy(to + (y + row) * header_.row_bytes() + x * pixel, tile.data() + row * width * pixel,
                      std::min(width, header_.width - x) * pixel);
        }
      }
    }
  }

  fs::path path_;
  OpenFile file_;
  std::uint64_t size_ = 0;
  std::uint64_t budget_ = 0;  // bytes that may still be read
  bool cut_ = false;          // more was to be read than there is
  bool complained_ = false;
  std::optional<std::size_t> page_;
  SliceHeader header_;
  bool compressed_ = false;
  std::vector<std::uint64_t> starts_;  // of the strips or tiles of a page that is not compressed, sorted
  double most_bytes_ = 0;              // that the file can hold when it is compressed like this page
  double needed_ = 0;                  // bytes of the file for all pages so far
  std::unique_ptr<TIFF, void (*)(TIFF*)> tiff_;
};

}  // namespace

bool looks_like_tiff(std::string_view head) {
  return head.starts_with(std::string_view("II*\0", 4)) || head.starts_with(std::string_view("MM\0*", 4)) ||
         head.starts_with(std::string_view("II+\0", 4)) || head.starts_with(std::string_view("MM\0+", 4));
}

std::unique_ptr<SliceFile> open_tiff(const fs::path& path) { return std::make_unique<TiffFile>(path); }

}  // namespace tunica::volume_format
