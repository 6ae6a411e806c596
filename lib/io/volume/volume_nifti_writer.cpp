#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/volume/volume_file.hpp"

#include <zlib.h>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>

namespace tunica {
namespace fs = std::filesystem;
namespace {

using Affine = Eigen::Matrix<double, 3, 4>;

template <class T>
void put(std::string& header, std::size_t offset, T value) {
  std::memcpy(header.data() + offset, &value, sizeof(T));
}

// In the order of Volume::Data's alternatives.
constexpr std::array<std::int16_t, 10> datatypes{2, 256, 512, 4, 768, 8, 1280, 1024, 16, 64};

// nifti1.h, "METHOD 2"; only a transform without shear has one.
void put_qform(std::string& header, const Affine& ras, const Vec3& spacing) {
  Mat3 rotation = ras.leftCols<3>() * spacing.cwiseInverse().asDiagonal();
  const bool mirrored = rotation.determinant() < 0;
  if (mirrored) {
    rotation.col(2) = -rotation.col(2);
  }
  put<float>(header, 76, mirrored ? -1.0F : 1.0F);
  if (!(rotation.transpose() * rotation).isIdentity(1e-6)) {
    return;
  }
  Eigen::Quaterniond q(rotation);
  q.normalize();
  if (q.w() < 0) {
    q.coeffs() = -q.coeffs();
  }
  put<std::int16_t>(header, 252, 1);
  put(header, 256, static_cast<float>(q.x()));
  put(header, 260, static_cast<float>(q.y()));
  put(header, 264, static_cast<float>(q.z()));
  for (std::size_t row = 0; row < 3; ++row) {
    put(header, 268 + 4 * row, static_cast<float>(ras(row, 3)));
  }
}

std::string header_of(const fs::path& path, const Volume& volume, std::size_t bytes_per_voxel) {
  std::string header(352, '\0');  // with the four zero bytes that say "no extensions"
  put<std::int32_t>(header, 0, 348);
  put<std::int16_t>(header, 40, 3);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (volume.dims[axis] > 32767 || volume.dims[axis] == 0) {
      throw InputError(fmt::format("{}: a volume of {} x {} x {} voxels does not fit NIfTI-1, whose sizes end at 32767",
                                   path.string(), volume.dims[0], volume.dims[1], volume.dims[2]));
    }
    put(header, 42 + 2 * axis, narrow<std::int16_t>(volume.dims[axis]));
  }
  for (std::size_t axis = 3; axis < 7; ++axis) {
    put<std::int16_t>(header, 42 + 2 * axis, 1);
  }
  put(header, 70, datatypes.at(volume.data.index()));
  put(header, 72, narrow<std::int16_t>(8 * bytes_per_voxel));
  Affine ras = volume.affine;
  ras.topRows<2>() = -ras.topRows<2>();
  const Vec3 spacing = ras.leftCols<3>().colwise().norm();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    put(header, 80 + 4 * axis, static_cast<float>(spacing[axis]));
  }
  put<float>(header, 108, 352);
  put(header, 112, static_cast<float>(volume.slope));
  put(header, 116, static_cast<float>(volume.intercept));
  put<std::uint8_t>(header, 123, 2);  // mm
  std::memcpy(header.data() + 148, "tunica", 6);
  put<std::int16_t>(header, 254, 1);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      put(header, 280 + 16 * row + 4 * column, static_cast<float>(ras(row, column)));
    }
  }
  put_qform(header, ras, spacing);
  std::memcpy(header.data() + 344, "n+1", 4);
  return header;
}

// Writes bytes to a file, through a gzip stream without name and time when asked to.
class Sink {
public:
  Sink(const fs::path& path, const fs::path& name, bool gzip)
      : name_(name), file_(std::fopen(path.c_str(), "wb"), &std::fclose), gzip_(gzip) {
    require(file_ != nullptr);
    if (gzip_ && deflateInit2(&stream_, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
      throw std::bad_alloc();
    }
  }
  ~Sink() {
    if (gzip_) {
      deflateEnd(&stream_);
    }
  }
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;

  void write(std::string_view bytes) {
    constexpr std::size_t at_once = std::size_t{1} << 24;
    for (std::size_t done = 0; done < bytes.size(); done += at_once) {
      check_interrupt();
      pass(bytes.substr(done, at_once), Z_NO_FLUSH);
    }
  }

  void finish() {
    if (gzip_) {
      pass({}, Z_FINISH);
    }
    require(std::fflush(file_.get()) == 0);
  }

private:
  void pass(std::string_view bytes, int flush) {
    if (!gzip_) {
      require(std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) == bytes.size());
      return;
    }
    std::string in(bytes);  // zlib's pointer to its input is not const
    stream_.next_in = reinterpret_cast<Bytef*>(in.data());
    stream_.avail_in = narrow<uInt>(in.size());
    do {
      stream_.next_out = buffer_.data();
      stream_.avail_out = narrow<uInt>(buffer_.size());
      deflate(&stream_, flush);
      const std::size_t made = buffer_.size() - stream_.avail_out;
      require(std::fwrite(buffer_.data(), 1, made, file_.get()) == made);
    } while (stream_.avail_out == 0);
  }

  void require(bool good) const {
    if (!good) {
      throw OutputError(fmt::format("{}: cannot be written: {}", name_.string(), file_error()));
    }
  }

  fs::path name_;
  OpenFile file_;
  bool gzip_;
  z_stream stream_{};
  std::vector<Bytef> buffer_ = std::vector<Bytef>(std::size_t{1} << 16);
};

// Source: nifti1.h, "extensions"; code 6 is text. Their lengths are multiples of 16.
std::string with_comment(std::string header, const std::string& text) {
  if (text.empty()) {
    return header;
  }
  constexpr std::size_t head = 8;
  constexpr std::int32_t comment = 6;
  const std::size_t length = (head + text.size() + 15) / 16 * 16;
  std::string extension(length, '\0');
  put(extension, 0, narrow<std::int32_t>(length));
  put(extension, 4, comment);
  extension.replace(head, text.size(), text);
  TUNICA_ASSERT(header.size() == 352);
  put(header, 108, static_cast<float>(header.size() + length));
  header[348] = 1;
  return header + extension;
}

}  // namespace

void write_nifti(const fs::path& path, const Volume& volume, bool overwrite, const std::string& made_by) {
  static_assert(std::endian::native == std::endian::little, "the header is written in the machine's byte order");
  require_volume(volume);
  std::visit(
      [&](const auto& values) {
        using T = typename std::decay_t<decltype(values)>::value_type;
        const std::string header = with_comment(header_of(path, volume, sizeof(T)), made_by);
        OutputFile output(path, overwrite);
        {
          Sink sink(output.partial_path(), path, path.extension() == ".gz");
          sink.write(header);
          sink.write({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
          sink.finish();
        }
        output.commit();
      },
      volume.data);
}

}  // namespace tunica
