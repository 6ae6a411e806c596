#pragma once

#include "support/temporary_folder.hpp"
#include "tunica/core/error.hpp"
#include "tunica/io/volume/volume_file.hpp"

#include <zlib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Volume files made by hand, byte by byte, independently of the library's own writer.
namespace tunica::test {

enum class Endian { little, big };

template <class T>
std::string encoded(T value, Endian endian) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  if (endian == Endian::big) {
    std::reverse(bytes.begin(), bytes.end());
  }
  return bytes;
}

template <class T>
std::string encoded(const std::vector<T>& values, Endian endian) {
  std::string bytes;
  for (const T value : values) {
    bytes += encoded(value, endian);
  }
  return bytes;
}

template <class T>
void put(std::string& bytes, std::size_t offset, T value, Endian endian = Endian::little) {
  bytes.replace(offset, sizeof(T), encoded(value, endian));
}

/// As gzip (bits 31) or zlib (bits 15).
inline std::string deflated(std::string bytes, int window_bits = 31) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 6, Z_DEFLATED, window_bits, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string out(deflateBound(&stream, bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(out.size() - stream.avail_out);
  deflateEnd(&stream);
  return out;
}

/// The volume in a file, read whole, without the warning of thick slices; fails the test where slabs of one, two or
/// three slices differ from it.
inline VolumeFile read_both_ways(const std::filesystem::path& path, const VolumeOptions& options = {}) {
  VolumeFile whole = read_volume(path, options);
  for (const std::size_t slices : {1, 2, 3}) {
    std::size_t next = 0;
    std::size_t taken = 0;
    const SlabSize size{std::size_t{1} << 20, slices};
    const VolumeFile file = read_volume_slabs(
        path, options, size, [&](const VolumeFile& header, const Volume& slab, std::size_t first_slice) {
          EXPECT_EQ(header.volume.dims, whole.volume.dims);
          EXPECT_EQ(slab.affine, whole.volume.affine);
          EXPECT_EQ(slab.slope, whole.volume.slope);
          EXPECT_EQ(slab.intercept, whole.volume.intercept);
          EXPECT_EQ(first_slice, next);
          next += slab.dims[2];
          std::visit(
              [&](const auto& values) {
                const auto& all = std::get<std::decay_t<decltype(values)>>(whole.volume.data);
                ASSERT_EQ(values.size(), slab.voxels());
                ASSERT_LE(taken + values.size(), all.size());
                EXPECT_EQ(std::memcmp(values.data(), all.data() + taken, values.size() * sizeof(values[0])), 0);
                taken += values.size();
              },
              slab.data);
        });
    EXPECT_EQ(next, whole.volume.dims[2]);
    EXPECT_EQ(texts_of(file.warnings), texts_of(whole.warnings));
    EXPECT_EQ(file.volume.label_names, whole.volume.label_names);
  }
  const VolumeFile header = read_volume_header(path, options);
  EXPECT_EQ(header.volume.dims, whole.volume.dims);
  EXPECT_EQ(header.datatype, whole.datatype);
  EXPECT_EQ(std::visit([](const auto& data) { return data.size(); }, header.volume.data), 0U);
  // Voxels here are of different lengths so that axes are told apart.
  std::erase_if(whole.warnings, [](const Warning& warning) { return warning.kind == "anisotropic voxels"; });
  return whole;
}

/// The error a file gives: its exit code and message; fails the test when it is read without error.
inline std::string error_of(const std::filesystem::path& path, const VolumeOptions& options = {},
                            ExitCode code = ExitCode::input) {
  try {
    read_volume(path, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_TRUE(std::string(error.what()).starts_with(path.parent_path().string())) << error.what();
    return error.what();
  }
  ADD_FAILURE() << path << " was read without error";
  return {};
}

/// All values as double.
inline std::vector<double> values_of(const Volume& volume) {
  return std::visit([](const auto& data) { return std::vector<double>(data.begin(), data.end()); }, volume.data);
}

/// Values that show the byte order, the sign and the place.
template <class T>
std::vector<T> sample_values(std::size_t count) {
  std::vector<T> values(count);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] = static_cast<T>(static_cast<T>(i * 3 + 1) * static_cast<T>(sizeof(T) > 1 ? 257 : 1));
  }
  if constexpr (std::is_signed_v<T>) {
    values[1] = static_cast<T>(-2);
  }
  return values;
}

struct NiftiOptions {
  int version = 1;
  Endian endian = Endian::little;
  std::vector<std::int64_t> dims{3, 4, 5};
  std::array<double, 4> pixdim{1, 2, 3, 4};  // qfac, dx, dy, dz
  int units = 2;
  double slope = 0;
  double intercept = 0;
  int sform_code = 1;
  std::array<double, 12> sform{2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  int qform_code = 0;
  std::array<double, 6> quatern{0, 0, 0, 0, 0, 0};  // b, c, d, x, y, z
  double vox_offset = -1;                           // right after the header
  bool pair = false;
};

inline std::string nifti_header(const NiftiOptions& options, int datatype, int bits) {
  const Endian e = options.endian;
  const bool one = options.version == 1;
  std::string h(one ? 352 : 544, '\0');
  const double offset = options.vox_offset >= 0 ? options.vox_offset : options.pair ? 0 : static_cast<double>(h.size());
  if (one) {
    put<std::int32_t>(h, 0, 348, e);
    put(h, 40, static_cast<std::int16_t>(options.dims.size()), e);
    for (std::size_t i = 0; i < options.dims.size(); ++i) {
      put(h, 42 + 2 * i, static_cast<std::int16_t>(options.dims[i]), e);
    }
    put(h, 70, static_cast<std::int16_t>(datatype), e);
    put(h, 72, static_cast<std::int16_t>(bits), e);
    for (std::size_t i = 0; i < 4; ++i) {
      put(h, 76 + 4 * i, static_cast<float>(options.pixdim[i]), e);
    }
    put(h, 108, static_cast<float>(offset), e);
    put(h, 112, static_cast<float>(options.slope), e);
    put(h, 116, static_cast<float>(options.intercept), e);
    put(h, 123, static_cast<std::uint8_t>(options.units), e);
    put(h, 252, static_cast<std::int16_t>(options.qform_code), e);
    put(h, 254, static_cast<std::int16_t>(options.sform_code), e);
    for (std::size_t i = 0; i < 6; ++i) {
      put(h, 256 + 4 * i, static_cast<float>(options.quatern[i]), e);
    }
    for (std::size_t i = 0; i < 12; ++i) {
      put(h, 280 + 4 * i, static_cast<float>(options.sform[i]), e);
    }
    h.replace(344, 4, std::string(options.pair ? "ni1" : "n+1") + '\0');
  } else {
    put<std::int32_t>(h, 0, 540, e);
    h.replace(4, 8, std::string(options.pair ? "ni2" : "n+2") + std::string("\0\r\n\x1a\n", 5));
    put(h, 12, static_cast<std::int16_t>(datatype), e);
    put(h, 14, static_cast<std::int16_t>(bits), e);
    put(h, 16, static_cast<std::int64_t>(options.dims.size()), e);
    for (std::size_t i = 0; i < options.dims.size(); ++i) {
      put(h, 24 + 8 * i, options.dims[i], e);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      put(h, 104 + 8 * i, options.pixdim[i], e);
    }
    put(h, 168, static_cast<std::int64_t>(offset), e);
    put(h, 176, options.slope, e);
    put(h, 184, options.intercept, e);
    put(h, 344, static_cast<std::int32_t>(options.qform_code), e);
    put(h, 348, static_cast<std::int32_t>(options.sform_code), e);
    for (std::size_t i = 0; i < 6; ++i) {
      put(h, 352 + 8 * i, options.quatern[i], e);
    }
    for (std::size_t i = 0; i < 12; ++i) {
      put(h, 400 + 8 * i, options.sform[i], e);
    }
    put(h, 500, static_cast<std::int32_t>(options.units), e);
  }
  return h;
}

inline const std::string voxels = encoded(sample_values<std::uint8_t>(60), Endian::little);

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

/// A 3 x 4 x 5 uint8 volume (60 voxels) unless told otherwise.
inline std::string nifti_file(const NiftiOptions& options = {}) {
  std::size_t count = 1;
  for (const auto size : options.dims) {
    count *= static_cast<std::size_t>(size);
  }
  return nifti_header(options, 2, 8) + encoded(sample_values<std::uint8_t>(count), options.endian);
}

inline std::string nrrd_header(std::string_view type = "uint8", std::string_view more = "encoding: raw\n") {
  return "NRRD0004\n# comment\ntype: " + std::string(type) +
         "\ndimension: 3\nspace: left-posterior-superior\nsizes: 3 4 5\n"
         "space directions: (2,0,0) (0,3,0) (0,0,4)\nkinds: domain domain domain\n"
         "space origin: (10,20,30)\n" +
         std::string(more) + "\n";
}

inline std::string metaimage_header(std::string_view type = "MET_UCHAR", std::string_view more = "",
                                    std::string_view data = "LOCAL") {
  return "ObjectType = Image\nNDims = 3\nBinaryData = True\n"
         "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 10 20 30\nElementSpacing = 2 3 4\nDimSize = 3 4 5\n" +
         std::string(more) + "ElementType = " + std::string(type) + "\nElementDataFile = " + std::string(data) + "\n";
}

/// As LZW of TIFF: literal codes of nine bits, the table cleared before ten are needed.
inline std::string lzw_coded(const std::string& bytes) {
  std::string bits;
  const auto put_code = [&](unsigned code) {
    for (int bit = 8; bit >= 0; --bit) {
      bits += (code >> bit & 1) != 0 ? '1' : '0';
    }
  };
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (i % 200 == 0) {
      put_code(256);
    }
    put_code(static_cast<unsigned char>(bytes[i]));
  }
  put_code(257);
  bits.resize((bits.size() + 7) / 8 * 8, '0');
  std::string out;
  for (std::size_t i = 0; i < bits.size(); i += 8) {
    out += static_cast<char>(std::stoi(bits.substr(i, 8), nullptr, 2));
  }
  return out;
}

/// As PackBits: literal runs.
inline std::string pack_bits_coded(const std::string& bytes) {
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 128) {
    const std::string run = bytes.substr(i, 128);
    out += static_cast<char>(run.size() - 1);
    out += run;
  }
  return out;
}

struct TiffOptions {
  Endian endian = Endian::little;
  bool big_tiff = false;
  int format = 1;       // 1 unsigned, 2 signed, 3 float
  int compression = 1;  // 1 none, 5 LZW, 8 deflate, 32773 PackBits
  int photometric = 1;
  int samples = 1;
  int orientation = 1;
  std::uint32_t rows = 0;  // of a strip or tile; 0: one strip
  std::uint32_t tile = 0;  // columns of a tile; 0: strips
  std::string description;
  /// Called with the stored bytes of every strip or tile, to damage them.
  std::function<void(std::size_t page, std::size_t part, std::string& stored)> damage;
};

/// A TIFF of pages of width x height pixels.
template <class T>
std::string tiff_file(std::uint32_t width, std::uint32_t height, const std::vector<std::vector<T>>& pages,
                      const TiffOptions& options = {}) {
  const Endian e = options.endian;
  const bool big = options.big_tiff;
  std::string file = e == Endian::big ? "MM" : "II";
  file += encoded<std::uint16_t>(big ? 43 : 42, e);
  if (big) {
    file += encoded<std::uint16_t>(8, e) + encoded<std::uint16_t>(0, e);
  }
  const auto word = [&](std::uint64_t value) {
    return big ? encoded<std::uint64_t>(value, e) : encoded(static_cast<std::uint32_t>(value), e);
  };
  const auto parts_of = [&](const std::vector<T>& page) {
    std::vector<std::vector<T>> parts;
    if (options.rows == 0) {
      return std::vector<std::vector<T>>{page};
    }
    const std::uint32_t columns = options.tile > 0 ? options.tile : width;
    for (std::uint32_t y = 0; y < height; y += options.rows) {
      for (std::uint32_t x = 0; x < width; x += columns) {
        auto& part = parts.emplace_back();
        for (std::uint32_t i = 0; i < options.rows * columns; ++i) {
          const std::uint32_t row = y + i / columns;
          const std::uint32_t column = x + i % columns;
          if (row < height && column < width) {
            part.push_back(page[row * width + column]);
          } else if (options.tile > 0) {
            part.push_back(0);
          }
        }
      }
    }
    return parts;
  };
  std::size_t link = file.size();
  file += word(0);
  for (std::size_t page = 0; page < pages.size(); ++page) {
    std::vector<std::uint32_t> offsets, sizes;
    for (const auto& part : parts_of(pages[page])) {
      std::string stored = encoded(part, e);
      stored = options.compression == 8       ? deflated(stored, 15)
               : options.compression == 5     ? lzw_coded(stored)
               : options.compression == 32773 ? pack_bits_coded(stored)
                                              : stored;
      if (options.damage) {
        options.damage(page, offsets.size(), stored);
      }
      offsets.push_back(static_cast<std::uint32_t>(file.size()));
      sizes.push_back(static_cast<std::uint32_t>(stored.size()));
      file += stored;
      file += std::string(file.size() % 2, '\0');
    }
    struct Entry {
      int tag;
      int type;
      std::string values;
    };
    const auto small = [&](int tag, std::size_t value) {
      return Entry{tag, 3, encoded(static_cast<std::uint16_t>(value), e)};
    };
    const auto large = [&](int tag, const std::vector<std::uint32_t>& values) {
      return Entry{tag, 4, encoded(values, e)};
    };
    const bool tiled = options.tile > 0;
    std::vector<Entry> entries{large(256, {width}),
                               large(257, {height}),
                               small(258, 8 * sizeof(T)),
                               small(259, static_cast<std::size_t>(options.compression)),
                               small(262, static_cast<std::size_t>(options.photometric)),
                               {270, 2, options.description},
                               small(274, static_cast<std::size_t>(options.orientation)),
                               small(277, static_cast<std::size_t>(options.samples)),
                               large(tiled ? 322 : 278, {tiled              ? options.tile
                                                         : options.rows > 0 ? options.rows
                                                                            : height}),
                               small(339, static_cast<std::size_t>(options.format))};
    if (tiled) {
      entries.push_back(large(323, {options.rows}));
    }
    entries.push_back(large(tiled ? 324 : 273, offsets));
    entries.push_back(large(tiled ? 325 : 279, sizes));
    std::erase_if(entries, [](const Entry& entry) { return entry.values.empty(); });
    std::sort(entries.begin(), entries.end(), [](const Entry& l, const Entry& r) { return l.tag < r.tag; });
    std::string table =
        big ? encoded<std::uint64_t>(entries.size(), e) : encoded(static_cast<std::uint16_t>(entries.size()), e);
    for (Entry& entry : entries) {
      const std::size_t each = entry.type == 2 ? 1 : entry.type == 3 ? 2 : 4;
      table += encoded(static_cast<std::uint16_t>(entry.tag), e) + encoded(static_cast<std::uint16_t>(entry.type), e) +
               word(entry.values.size() / each);
      if (entry.values.size() > word(0).size()) {
        const std::string here = word(file.size());
        file += entry.values + std::string(entry.values.size() % 2, '\0');
        entry.values = here;
      }
      entry.values.resize(word(0).size(), '\0');
      table += entry.values;
    }
    const std::string here = word(file.size());
    file.replace(link, here.size(), here);
    file += table;
    link = file.size();
    file += word(0);
  }
  return file;
}

inline std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const auto checksum =
      static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
  return encoded(static_cast<std::uint32_t>(data.size()), Endian::big) + body + encoded(checksum, Endian::big);
}

/// A grey PNG of 8 or 16 bits.
template <class T>
std::string png_file(std::uint32_t width, std::uint32_t height, const std::vector<T>& pixels, int colour_type = 0,
                     int bits = 8 * sizeof(T)) {
  std::string rows;
  for (std::uint32_t row = 0; row < height; ++row) {
    rows += '\0';  // no filter
    rows += encoded(std::vector<T>(pixels.begin() + row * width, pixels.begin() + (row + 1) * width), Endian::big);
  }
  const std::string header = encoded(width, Endian::big) + encoded(height, Endian::big) + static_cast<char>(bits) +
                             static_cast<char>(colour_type) + std::string(3, '\0');
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + png_chunk("IDAT", deflated(rows, 15)) +
         png_chunk("IEND", "");
}

/// A PNG mask of `bits` per pixel, several pixels a byte; with a palette where `colour_type` is 3.
inline std::string packed_png(std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& pixels,
                              int bits, int colour_type) {
  std::string rows;
  for (std::uint32_t row = 0; row < height; ++row) {
    rows += '\0';
    std::string bytes((width * static_cast<std::uint32_t>(bits) + 7) / 8, '\0');
    for (std::uint32_t i = 0; i < width; ++i) {
      const std::size_t at = i * static_cast<std::size_t>(bits);
      bytes[at / 8] = static_cast<char>(static_cast<unsigned char>(bytes[at / 8]) |
                                        pixels[row * width + i] << (8 - bits - static_cast<int>(at % 8)));
    }
    rows += bytes;
  }
  const std::string header = encoded(width, Endian::big) + encoded(height, Endian::big) + static_cast<char>(bits) +
                             static_cast<char>(colour_type) + std::string(3, '\0');
  std::string palette;
  for (int colour = 0; colour < 1 << bits; ++colour) {
    palette += {static_cast<char>(255 - colour), '\7', static_cast<char>(colour)};
  }
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) +
         (colour_type == 3 ? png_chunk("PLTE", palette) + png_chunk("tRNS", std::string(1, '\0')) : "") +
         png_chunk("IDAT", deflated(rows, 15)) + png_chunk("IEND", "");
}

/// The affine all headers above give: spacing 2 x 3 x 4, origin (10, 20, 30), in the file's own world.
inline Eigen::Matrix<double, 3, 4> sample_affine() {
  Eigen::Matrix<double, 3, 4> affine;
  affine << 2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30;
  return affine;
}

}  // namespace tunica::test
