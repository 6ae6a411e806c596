// PNG (RFC 2083) by libpng 1.6

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/encoding.hpp"
#include "tunica/io/volume/detail/slice_file.hpp"

#include <png.h>

#include <fmt/format.h>

#include <bit>
#include <cstring>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

class PngFile : public SliceFile {
public:
  explicit PngFile(const fs::path& path) : path_(path), file_(open_input(path)) {
    std::error_code error;
    size_ = fs::file_size(path, error);
    if (error) {
      throw InputError(fmt::format("{}: cannot be read: {}", path.string(), error.message()));
    }
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, &fail, &complain);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngFile() override { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngFile(const PngFile&) = delete;
  PngFile& operator=(const PngFile&) = delete;

  [[nodiscard]] const char* format() const override { return "PNG"; }

  std::optional<SliceHeader> next() override {
    if (header_) {
      return {};
    }
    const bool read = succeeds([&] {
      png_init_io(png_, file_.get());
      png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
      // Profiles and texts say nothing of the pixels, and may be as wrong or as large as they like.
      png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
      png_set_crc_action(png_, PNG_CRC_ERROR_QUIT, PNG_CRC_QUIET_USE);
      png_read_info(png_, info_);
    });
    if (!read) {
      throw InputError(fmt::format("{}: its PNG header is truncated or corrupt; get the file again", path_.string()));
    }
    header_ = checked_header();
    return header_;
  }

  void decode(char* to) override {
    complained_ = false;
    bool whole = succeeds([&] {
      if (header_->type == VoxelType::uint16 && std::endian::native == std::endian::little) {
        png_set_swap(png_);
      }
      png_set_packing(png_);  // of 1, 2 and 4 bits: a byte each, with the values they have
      passes_ = png_set_interlace_handling(png_);
      png_start_read_image(png_);
    });
    for (int pass = 0; pass < passes_ && whole; ++pass) {
      for (std::uint64_t row = 0; row < header_->height && whole; ++row) {
        check_interrupt();
        auto* bytes = reinterpret_cast<png_bytep>(to + row * header_->row_bytes());
        whole = succeeds([&] { png_read_row(png_, bytes, nullptr); });
      }
    }
    if (!whole || !succeeds([&] { png_read_end(png_, nullptr); }) || complained_) {
      throw InputError(fmt::format(
          "{}: its pixels cannot be decoded: the PNG file is truncated or corrupt; get it again", path_.string()));
    }
  }

private:
  [[noreturn]] static void fail(png_structp png, png_const_charp) { png_longjmp(png, 1); }
  static void complain(png_structp png, png_const_charp) {
    static_cast<PngFile*>(png_get_error_ptr(png))->complained_ = true;
  }

  // libpng leaves `step` by a jump where it fails: nothing in there may need a destructor.
  template <class Step>
  bool succeeds(Step step) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    step();
    return true;
  }

  SliceHeader checked_header() {
    const unsigned width = png_get_image_width(png_, info_);
    const unsigned height = png_get_image_height(png_, info_);
    const unsigned bits = png_get_bit_depth(png_, info_);
    const unsigned colour = png_get_color_type(png_, info_);
    // With a palette the labels are the numbers of its colours, as programs that paint masks mean them.
    if (colour != PNG_COLOR_TYPE_GRAY && colour != PNG_COLOR_TYPE_PALETTE) {
      throw InputError(
          fmt::format("{}: has colours (PNG colour type {}): save one grey value per pixel", path_.string(), colour));
    }
    if (colour == PNG_COLOR_TYPE_GRAY && png_get_valid(png_, info_, PNG_INFO_tRNS) != 0) {
      throw InputError(fmt::format("{}: has a transparent grey value: save it without", path_.string()));
    }
    const SliceHeader header{width, height, bits == 16 ? VoxelType::uint16 : VoxelType::uint8};
    if (real(png_get_rowbytes(png_, info_)) * height > deflate_expansion * real(size_)) {
      throw InputError(
          fmt::format("{}: has {} x {} pixels, more than its bytes can hold: it is truncated; get it again",
                      path_.string(), width, height));
    }
    return header;
  }

  fs::path path_;
  OpenFile file_;
  std::uint64_t size_ = 0;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::optional<SliceHeader> header_;
  int passes_ = 0;
  bool complained_ = false;
};

}  // namespace

bool looks_like_png(std::string_view head) { return head.starts_with("\x89PNG\r\n\x1a\n"); }

std::unique_ptr<SliceFile> open_png(const fs::path& path) { return std::make_unique<PngFile>(path); }

}  // namespace tunica::volume_format
