#include "io/volume/builders.hpp"

namespace tunica::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

VolumeOptions with_spacing() {
  VolumeOptions options;
  options.spacing = Vec3(0.5, 0.25, 2);
  return options;
}

template <class T>
std::vector<std::vector<T>> sample_pages(std::size_t pages, std::size_t pixels) {
  std::vector<std::vector<T>> result;
  const auto all = sample_values<T>(pages * pixels);
  for (std::size_t page = 0; page < pages; ++page) {
    result.emplace_back(all.begin() + static_cast<long>(page * pixels),
                        all.begin() + static_cast<long>((page + 1) * pixels));
  }
  return result;
}

template <class T>
class TiffType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t, std::int32_t,
                             std::uint64_t, std::int64_t, float, double>;
TYPED_TEST_SUITE(TiffType, Types);

struct Layout {
  std::uint32_t rows;
  std::uint32_t tile;
};
constexpr std::array layouts{Layout{0, 0}, Layout{2, 0}, Layout{2, 3}};
constexpr std::array compressions{1, 5, 8, 32773};

TYPED_TEST(TiffType, EveryEndianSizeLayoutAndCompression) {
  using T = TypeParam;
  const TemporaryFolder folder;
  const auto pages = sample_pages<T>(20, 7 * 5);
  for (const Endian endian : {Endian::little, Endian::big}) {
    for (const bool big_tiff : {false, true}) {
      for (std::size_t n = 0; n < layouts.size() * compressions.size(); ++n) {
        TiffOptions options;
        options.endian = endian;
        options.big_tiff = big_tiff;
        options.compression = compressions[n % compressions.size()];
        options.rows = layouts[n / compressions.size()].rows;
        options.tile = layouts[n / compressions.size()].tile;
        options.format = std::is_floating_point_v<T> ? 3 : std::is_signed_v<T> ? 2 : 1;
        const VolumeFile file =
            read_both_ways(folder.file("v.tif", tiff_file<T>(7, 5, pages, options)), with_spacing());
        EXPECT_EQ(std::get<std::vector<T>>(file.volume.data), sample_values<T>(700));
        EXPECT_EQ(file.volume.dims, (std::array<std::size_t, 3>{7, 5, 20}));
        EXPECT_EQ(file.spacing, Vec3(0.5, 0.25, 2));
        EXPECT_EQ(file.format, "TIFF stack");
        EXPECT_THAT(file.warnings, IsEmpty());
      }
    }
  }
}

TEST(Tiff, All256GreyValuesComeAsTheyAre) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> page(256);
  for (std::size_t i = 0; i < page.size(); ++i) {
    page[i] = static_cast<std::uint8_t>(i);
  }
  const VolumeFile file =
      read_both_ways(folder.file("v.tif", tiff_file<std::uint8_t>(16, 16, {page, page})), with_spacing());
  for (std::size_t i = 0; i < 512; ++i) {
    EXPECT_EQ(std::get<0>(file.volume.data)[i], i % 256);
  }
}

TEST(Tiff, SpacingIsRequiredAndOthersRefuseIt) {
  const TemporaryFolder folder;
  const auto path = folder.file("v.tif", tiff_file<std::uint8_t>(7, 5, sample_pages<std::uint8_t>(3, 35)));
  EXPECT_THAT(error_of(path, {}, ExitCode::usage), HasSubstr("--spacing 0.5,0.5,1.25"));
  EXPECT_THAT(error_of(folder.file("v.nii", nifti_file()), with_spacing(), ExitCode::usage), HasSubstr("--spacing"));
}

TEST(Tiff, EveryTruncationIsNoticed) {
  const TemporaryFolder folder;
  const std::string bytes = tiff_file<std::uint16_t>(7, 5, sample_pages<std::uint16_t>(4, 35));
  for (std::size_t size = 4; size < bytes.size(); ++size) {
    EXPECT_THAT(error_of(folder.file("v.tif", bytes.substr(0, size)), with_spacing()), HasSubstr("truncated")) << size;
  }
}

// The codecs give up at what is damaged and leave the rest as it was: black, if nobody looks.
TEST(Tiff, EveryStripAndTileIsChecked) {
  const TemporaryFolder folder;
  const auto pages = sample_pages<std::uint16_t>(3, 70 * 50);
  for (const Layout layout : {Layout{10, 0}, Layout{16, 16}}) {
    for (const int compression : compressions) {
      for (const std::size_t damaged : {1, 2, 4}) {
        TiffOptions options;
        options.compression = compression;
        options.rows = layout.rows;
        options.tile = layout.tile;
        options.damage = [&](std::size_t page, std::size_t part, std::string& stored) {
          if (page == 1 && part == damaged && compression == 1) {
            stored.resize(stored.size() - 2);
          } else if (page == 1 && part == damaged) {
            // No code of deflate or LZW; to PackBits, nothing.
            std::fill(stored.begin() + static_cast<long>(stored.size() / 2), stored.end(),
                      compression == 32773 ? '\x80' : '\xff');
          }
        };
        testing::internal::CaptureStderr();
        EXPECT_THAT(error_of(folder.file("v.tif", tiff_file<std::uint16_t>(70, 50, pages, options)), with_spacing()),
                    AllOf(HasSubstr("page 1 cannot be decoded"),
                          HasSubstr((layout.tile > 0 ? "tile " : "strip ") + std::to_string(damaged) + " ")))
            << compression;
        EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
      }
    }
  }
}

TEST(Tiff, StripsThatAreNotThere) {
  const TemporaryFolder folder;
  TiffOptions options;
  options.rows = 10;
  options.compression = 8;
  options.damage = [](std::size_t, std::size_t part, std::string& stored) {
    stored.resize(part == 3 ? 0 : stored.size());
  };
  EXPECT_THAT(
      error_of(folder.file("v.tif", tiff_file<std::uint8_t>(70, 50, sample_pages<std::uint8_t>(3, 3500), options)),
               with_spacing()),
      HasSubstr("strip 3"));
}

TEST(Tiff, WhatWouldComeOutWrongIsRefused) {
  const TemporaryFolder folder;
  const auto pages = sample_pages<std::uint8_t>(3, 35);
  const auto refuse = [&](const TiffOptions& options, const std::string& message) {
    EXPECT_THAT(error_of(folder.file("v.tif", tiff_file<std::uint8_t>(7, 5, pages, options)), with_spacing()),
                HasSubstr(message));
  };
  TiffOptions options;
  options.photometric = 0;
  refuse(options, "white as 0");
  options.photometric = 2;
  refuse(options, "colours");
  options = {};
  options.samples = 3;
  refuse(options, "colours");
  options = {};
  options.orientation = 3;
  refuse(options, "orientation 3");
  options = {};
  options.compression = 7;
  refuse(options, "compressed by method 7");
  options = {};
  options.format = 3;
  refuse(options, "8 bits");
  const std::string imagej = std::string("ImageJ=1.53\nimages=40\nslices=40\n") + '\0';
  options = {};
  options.description = imagej;
  EXPECT_THAT(error_of(folder.file("v.tif", tiff_file<std::uint8_t>(7, 5, {pages[0]}, options)), with_spacing()),
              HasSubstr("holds 40 slices"));
}

TEST(Tiff, HostileTables) {
  const TemporaryFolder folder;
  // A page of 2^20 x 2^20 pixels in a file of a hundred bytes.
  std::string bytes = tiff_file<std::uint8_t>(1U << 20, 1U << 20, sample_pages<std::uint8_t>(2, 35));
  EXPECT_THAT(error_of(folder.file("v.tif", bytes), with_spacing()), HasSubstr("more than the file's bytes can hold"));
  // The last page's link leads back to the first page.
  bytes = tiff_file<std::uint8_t>(7, 5, sample_pages<std::uint8_t>(2, 35));
  bytes.replace(bytes.size() - 4, 4, bytes.substr(4, 4));
  EXPECT_THAT(error_of(folder.file("v.tif", bytes), with_spacing()),
              HasSubstr("page 2 and what follows cannot be read"));
  bytes = tiff_file<std::uint8_t>(7, 5, {});
  EXPECT_THAT(error_of(folder.file("v.tif", bytes), with_spacing()), HasSubstr("no page"));
  // A tile of 2^28 pixels around a page of 35.
  TiffOptions options;
  options.rows = 5;
  options.tile = 7;
  bytes = tiff_file<std::uint8_t>(7, 5, sample_pages<std::uint8_t>(2, 35), options);
  const std::string tag = encoded<std::uint32_t>(322 | 4U << 16, Endian::little);
  for (std::size_t at = bytes.find(tag); at != std::string::npos; at = bytes.find(tag, at + 1)) {
    put<std::uint32_t>(bytes, at + 8, 1U << 14);
    put<std::uint32_t>(bytes, at + 20, 1U << 14);
  }
  EXPECT_THAT(error_of(folder.file("v.tif", bytes), with_spacing()), HasSubstr("has tiles of 16384 x 16384"));
}

TEST(Folder, SlicesInNaturalOrder) {
  const TemporaryFolder folder;
  const auto stack = folder / "stack";
  for (const std::string extension : {".png", ".tif"}) {
    std::filesystem::remove_all(stack);
    std::filesystem::create_directory(stack);
    for (std::uint16_t i = 8; i < 12; ++i) {
      const std::vector<std::uint16_t> pixels(35, static_cast<std::uint16_t>(1000 * i));
      folder.file("stack/slice" + std::to_string(i) + extension,
                  extension == ".png" ? png_file(7, 5, pixels) : tiff_file<std::uint16_t>(7, 5, {pixels}));
    }
    const VolumeFile file = read_both_ways(stack, with_spacing());
    EXPECT_EQ(file.volume.dims, (std::array<std::size_t, 3>{7, 5, 4}));
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(std::get<std::vector<std::uint16_t>>(file.volume.data)[35 * k + 3], 1000 * (8 + k));
    }
    EXPECT_EQ(file.data_files.size(), 4U);
    EXPECT_THAT(file.warnings, IsEmpty());
    folder.file("stack/notes.txt", "x");
    std::filesystem::remove(stack / ("slice9" + extension));
    EXPECT_THAT(texts_of(read_both_ways(stack, with_spacing()).warnings),
                ElementsAre(HasSubstr("1 files that are no slices"), HasSubstr("between slice8")));
  }
}

TEST(Folder, OneSeriesAlone) {
  const TemporaryFolder folder;
  const auto stack = folder / "stack";
  std::filesystem::create_directory(stack);
  std::filesystem::create_directory(folder / "numbers");
  const std::string page = png_file(7, 5, sample_values<std::uint8_t>(35));
  for (const char* name : {"a000", "a001", "b000", "b001"}) {
    folder.file(std::string("stack/") + name + ".png", page);
  }
  EXPECT_THAT(error_of(stack, with_spacing()),
              HasSubstr("2 series, as their names say, 2 like a000.png, 2 like b000.png"));
  std::filesystem::remove(stack / "b000.png");
  std::filesystem::rename(stack / "b001.png", stack / "preview.png");
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("1 like preview.png: leave one series"));
  std::filesystem::remove(stack / "preview.png");
  std::filesystem::rename(stack / "a001.png", stack / "a-1.5.png");
  std::filesystem::rename(stack / "a000.png", stack / "a-3.0.png");
  folder.file("stack/a1.5.png", page);
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("numbers with and without a sign"));
  std::filesystem::remove(stack / "a1.5.png");
  EXPECT_EQ(read_both_ways(stack, with_spacing()).volume.dims[2], 2U);
  for (const char* name : {"000", "001", "1"}) {
    folder.file(std::string("numbers/") + name + ".png", page);
  }
  EXPECT_THAT(error_of(folder / "numbers", with_spacing()), HasSubstr("001.png and 1.png have one number"));
}

TEST(Folder, WhatIsNoStackIsRefused) {
  const TemporaryFolder folder;
  const auto stack = folder / "stack";
  std::filesystem::create_directory(stack);
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("holds no .png, .tif or .tiff slices"));
  folder.file("stack/a1.png", png_file(7, 5, sample_values<std::uint8_t>(35)));
  folder.file("stack/a2.png", png_file(5, 7, sample_values<std::uint8_t>(35)));
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("must be alike"));
  folder.file("stack/a2.png", png_file(7, 5, sample_values<std::uint16_t>(35)));
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("must be alike"));
  folder.file("stack/a2.png", png_file(7, 5, sample_values<std::uint8_t>(35), 4));
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("colour type 4"));
  folder.file("stack/a2.png", "hello");
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("neither TIFF nor PNG"));
  folder.file("stack/a2.png", "");
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("is empty"));
  folder.file("stack/a2.png", tiff_file<std::uint8_t>(7, 5, sample_pages<std::uint8_t>(2, 35)));
  EXPECT_THAT(error_of(stack, with_spacing()), HasSubstr("has 2 pages"));
}

TEST(Png, MasksOfFewBitsAndWithAPaletteKeepTheirNumbers) {
  const TemporaryFolder folder;
  const auto stack = folder / "stack";
  std::filesystem::create_directory(stack);
  for (const int colour_type : {0, 3}) {
    for (const int bits : {1, 2, 4, 8}) {
      std::vector<std::uint8_t> pixels(35);
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        pixels[i] = static_cast<std::uint8_t>(7 * i % (1U << bits));
      }
      for (const char* name : {"stack/1.png", "stack/2.png"}) {
        folder.file(name, packed_png(7, 5, pixels, bits, colour_type));
      }
      const VolumeFile file = read_both_ways(stack, with_spacing());
      EXPECT_EQ(file.datatype, "uint8");
      auto expected = pixels;
      expected.insert(expected.end(), pixels.begin(), pixels.end());
      EXPECT_EQ(std::get<std::vector<std::uint8_t>>(file.volume.data), expected) << bits << ' ' << colour_type;
      EXPECT_THAT(file.warnings, IsEmpty());
    }
  }
}

TEST(Png, EveryTruncationIsNoticed) {
  const TemporaryFolder folder;
  const std::string bytes = png_file(7, 5, sample_values<std::uint16_t>(35));
  for (std::size_t size = 8; size < bytes.size(); ++size) {
    EXPECT_THAT(error_of(folder.file("v.png", bytes.substr(0, size)), with_spacing()), HasSubstr("truncated"));
  }
  EXPECT_THAT(texts_of(read_both_ways(folder.file("v.png", bytes), with_spacing()).warnings),
              ElementsAre(HasSubstr("single slice")));
}

TEST(Png, Hostile) {
  const TemporaryFolder folder;
  testing::internal::CaptureStderr();
  std::string bytes = png_file(7, 5, sample_values<std::uint16_t>(35));
  bytes[45] = static_cast<char>(bytes[45] ^ 1);
  EXPECT_THAT(error_of(folder.file("v.png", bytes), with_spacing()), HasSubstr("cannot be decoded"));
  bytes = png_file(7, 5, sample_values<std::uint16_t>(35));
  const std::string ihdr = bytes.substr(0, 33);
  const auto with_pixels = [&](const std::string& data) {
    return folder.file("v.png", ihdr + png_chunk("IDAT", data) + png_chunk("IEND", ""));
  };
  EXPECT_THAT(error_of(with_pixels(deflated(std::string(70, '\0'), 15)), with_spacing()),
              HasSubstr("cannot be decoded"));
  EXPECT_THAT(error_of(with_pixels(deflated(std::string(75, '\5'), 15)), with_spacing()),
              HasSubstr("cannot be decoded"));
  EXPECT_THAT(error_of(with_pixels("not deflated at all"), with_spacing()), HasSubstr("cannot be decoded"));
  const std::string header = encoded<std::uint32_t>(1U << 20, Endian::big) +
                             encoded<std::uint32_t>(1U << 20, Endian::big) + "\x08" + std::string(4, '\0');
  bytes =
      "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + png_chunk("IDAT", deflated("x", 15)) + png_chunk("IEND", "");
  EXPECT_THAT(error_of(folder.file("v.png", bytes), with_spacing()), HasSubstr("more than its bytes can hold"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// Profiles and texts are none of a volume's business, however wrong.
TEST(Png, AncillaryChunksAreIgnored) {
  const TemporaryFolder folder;
  const std::string bytes = png_file(7, 5, sample_values<std::uint16_t>(35));
  std::string profile = png_chunk("iCCP", "no profile");
  profile.back() = static_cast<char>(profile.back() ^ 1);
  const std::string text = png_chunk("zTXt", std::string("Comment\0\0", 9) + deflated(std::string(1U << 25, 'x'), 15));
  const VolumeFile file =
      read_both_ways(folder.file("v.png", bytes.substr(0, 33) + profile + text + bytes.substr(33)), with_spacing());
  EXPECT_EQ(std::get<std::vector<std::uint16_t>>(file.volume.data), sample_values<std::uint16_t>(35));
}

}  // namespace
}  // namespace tunica::test
