#include "io/volume/builders.hpp"

namespace tunica::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

template <class T>
class MetaImageType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t, std::int32_t,
                             std::uint64_t, std::int64_t, float, double>;
TYPED_TEST_SUITE(MetaImageType, Types);

TYPED_TEST(MetaImageType, EveryNameEndianAndCompression) {
  const TemporaryFolder folder;
  const std::array<std::vector<std::string>, 10> names{{{"MET_UCHAR"},
                                                        {"MET_CHAR"},
                                                        {"MET_USHORT"},
                                                        {"MET_SHORT"},
                                                        {"MET_UINT", "MET_ULONG"},
                                                        {"MET_INT", "MET_LONG"},
                                                        {"MET_ULONG_LONG"},
                                                        {"MET_LONG_LONG"},
                                                        {"MET_FLOAT"},
                                                        {"MET_DOUBLE"}}};
  const auto values = sample_values<TypeParam>(60);
  for (const std::string& name : names.at(Volume::Data(values).index())) {
    for (const Endian endian : {Endian::little, Endian::big}) {
      for (const std::string order : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}) {
        const std::string more = order + (endian == Endian::big ? " = True\n" : " = False\n");
        const std::string bytes = encoded(values, endian);
        const std::string packed = deflated(bytes, 15);
        const std::string size = "CompressedDataSize = " + std::to_string(packed.size()) + "\n";
        for (const std::string& file :
             {metaimage_header(name, more) + bytes, metaimage_header(name, more + "CompressedData = True\n") + packed,
              metaimage_header(name, more + "CompressedData = True\n" + size) + packed}) {
          const VolumeFile read = read_both_ways(folder.file("v.mha", file));
          EXPECT_EQ(std::get<std::vector<TypeParam>>(read.volume.data), values);
          EXPECT_TRUE(read.volume.affine.isApprox(sample_affine()));
          EXPECT_EQ(read.orientation, "LPS");
          EXPECT_THAT(read.warnings, IsEmpty());
        }
      }
    }
  }
}

TEST(MetaImage, TheMatrixListsTheDirectionOfEachIndexAxis) {
  const TemporaryFolder folder;
  const std::string header =
      replaced(metaimage_header(), "TransformMatrix = 1 0 0 0 1 0 0 0 1", "TransformMatrix = 0 1 0 0 0 1 1 0 0");
  const VolumeFile file = read_both_ways(folder.file("v.mha", header + voxels));
  Eigen::Matrix<double, 3, 4> expected;
  expected << 0, 0, 4, 10, 2, 0, 0, 20, 0, 3, 0, 30;
  EXPECT_TRUE(file.volume.affine.isApprox(expected)) << file.volume.affine;
  EXPECT_EQ(file.orientation, "PSL");
}

TEST(MetaImage, DetachedData) {
  const TemporaryFolder folder;
  folder.file("v.raw", "skipme" + voxels);
  EXPECT_EQ(
      values_of(
          read_both_ways(folder.file("a.mhd", metaimage_header("MET_UCHAR", "HeaderSize = 6\n", "v.raw"))).volume)[7],
      22);
  EXPECT_EQ(
      values_of(
          read_both_ways(folder.file("a.mhd", metaimage_header("MET_UCHAR", "HeaderSize = -1\n", "v.raw"))).volume)[7],
      22);
  folder.file("v.zraw", deflated(voxels, 15));
  const VolumeFile file =
      read_both_ways(folder.file("a.mhd", metaimage_header("MET_UCHAR", "CompressedData = True\n", "v.zraw")));
  EXPECT_EQ(values_of(file.volume)[7], 22);
  EXPECT_THAT(file.data_files, ElementsAre(folder / "v.zraw"));
  for (const std::string name : {"/etc/passwd", "../v.raw"}) {
    EXPECT_THAT(error_of(folder.file("a.mhd", metaimage_header("MET_UCHAR", "", name))),
                HasSubstr("not in the header's own folder"));
  }
  for (const std::string name : {"LIST", "v%02d.raw 1 5 1"}) {
    EXPECT_THAT(error_of(folder.file("a.mhd", metaimage_header("MET_UCHAR", "", name))),
                HasSubstr("several data files"));
  }
  EXPECT_THAT(error_of(folder.file("a.mhd", metaimage_header("MET_UCHAR", "", "none.raw"))),
              HasSubstr("none.raw is missing"));
}

TEST(MetaImage, FramesChannelsAndDimensions) {
  const TemporaryFolder folder;
  std::string header = metaimage_header();
  header = replaced(header, "NDims = 3", "NDims = 4");
  header = replaced(header, "1 0 0 0 1 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
  header = replaced(header, "Offset = 10 20 30", "Offset = 10 20 30 0");
  header = replaced(header, "ElementSpacing = 2 3 4", "ElementSpacing = 2 3 4 1");
  header = replaced(header, "DimSize = 3 4 5", "DimSize = 3 4 5 2");
  std::string both = voxels + voxels;
  both[60] = 77;
  const auto path = folder.file("v.mha", header + both);
  EXPECT_THAT(error_of(path), HasSubstr("has 2 frames: choose one with --frame 0..1"));
  VolumeOptions options;
  options.frame = 1;
  const VolumeFile file = read_both_ways(path, options);
  EXPECT_EQ(values_of(file.volume)[0], 77);
  EXPECT_TRUE(file.volume.affine.isApprox(sample_affine()));
  EXPECT_THAT(error_of(folder.file("v.mha", metaimage_header("MET_UCHAR", "ElementNumberOfChannels = 3\n") + voxels)),
              HasSubstr("3 values per voxel"));
  EXPECT_THAT(error_of(folder.file("v.mha", replaced(metaimage_header(), "NDims = 3", "NDims = 2") + voxels)),
              HasSubstr("2 dimensions"));
}

TEST(MetaImage, TextVoxels) {
  const TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 60; ++i) {
    text += std::to_string(i - 5) + " ";
  }
  const std::string header = replaced(metaimage_header("MET_SHORT"), "BinaryData = True", "BinaryData = False");
  EXPECT_EQ(values_of(read_both_ways(folder.file("v.mha", header + text)).volume)[2], -3);
}

TEST(MetaImage, WithoutSpacingOrMatrixWarns) {
  const TemporaryFolder folder;
  std::string header = replaced(metaimage_header(), "ElementSpacing = 2 3 4\n", "");
  header = replaced(header, "TransformMatrix = 1 0 0 0 1 0 0 0 1\n", "");
  EXPECT_THAT(texts_of(read_both_ways(folder.file("v.mha", header + voxels)).warnings),
              ElementsAre(HasSubstr("no ElementSpacing"), HasSubstr("no TransformMatrix")));
}

TEST(MetaImageDamage, TruncatedAnywhere) {
  const TemporaryFolder folder;
  const std::string raw = metaimage_header() + voxels;
  for (std::size_t size = 1; size < raw.size(); ++size) {
    const std::string message = error_of(folder.file("v.mha", raw.substr(0, size)));
    if (size >= raw.size() - 60) {
      EXPECT_THAT(message,
                  AllOf(HasSubstr("truncated: "), HasSubstr(std::to_string(raw.size() - size) + " of the 60")));
    }
  }
  const std::string packed = deflated(voxels, 15);
  const std::string header = metaimage_header(
      "MET_UCHAR", "CompressedData = True\nCompressedDataSize = " + std::to_string(packed.size()) + "\n");
  EXPECT_THAT(error_of(folder.file("v.mha", header + packed.substr(0, packed.size() - 7))), HasSubstr("truncated: "));
}

TEST(MetaImage, AStatedCompressedSizeThatIsTooLargeIsANote) {
  const TemporaryFolder folder;
  const std::string packed = deflated(voxels, 15);
  const std::string header = metaimage_header("MET_UCHAR", "CompressedData = True\nCompressedDataSize = 9999\n");
  const VolumeFile file = read_both_ways(folder.file("v.mha", header + packed));
  EXPECT_EQ(values_of(file.volume), values_of(read_volume(folder.file("p.mha", metaimage_header() + voxels)).volume));
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_EQ(file.warnings[0].weight, Weight::note);
  EXPECT_THAT(file.warnings[0].text, HasSubstr("promises 9999 bytes of compressed voxels, and " +
                                               std::to_string(packed.size()) + " are there"));
  for (std::size_t size = 1; size < packed.size(); ++size) {
    EXPECT_THAT(error_of(folder.file("v.mha", header + packed.substr(0, size))), HasSubstr("truncated: "));
  }
}

TEST(MetaImage, AChannelBeforeThreeAxesOfSpace) {
  const TemporaryFolder folder;
  std::string header = replaced(metaimage_header(), "NDims = 3", "NDims = 4");
  header = replaced(header, "1 0 0 0 1 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
  header = replaced(header, "Offset = 10 20 30", "Offset = 0 10 20 30");
  header = replaced(header, "ElementSpacing = 2 3 4", "ElementSpacing = 1 2 3 4");
  header = replaced(header, "DimSize = 3 4 5", "DimSize = 1 3 4 5");
  const VolumeFile file = read_both_ways(folder.file("v.mha", header + voxels));
  EXPECT_EQ(file.volume.dims, (std::array<std::size_t, 3>{3, 4, 5}));
  EXPECT_TRUE(file.volume.affine.isApprox(sample_affine()));
  EXPECT_THAT(texts_of(file.warnings), ElementsAre(HasSubstr("the leading 1 is taken as a channel")));
  header = replaced(header, "DimSize = 1 3 4 5", "DimSize = 2 3 4 5");
  EXPECT_THAT(error_of(folder.file("v.mha", header + voxels + voxels)), HasSubstr("looks like 2 channels"));
}

TEST(MetaImage, AMatrixWithoutVolumeIsNamed) {
  const TemporaryFolder folder;
  for (const auto& [matrix, why] :
       {std::pair("0 0 0 0 0 0 0 0 0", "is all zero"), {"1 0 0 1 0 0 0 0 1", "is singular or nearly so"}}) {
    EXPECT_THAT(error_of(folder.file("v.mha", replaced(metaimage_header(), "1 0 0 0 1 0 0 0 1", matrix) + voxels)),
                HasSubstr(std::string("its TransformMatrix ") + why));
  }
}

TEST(MetaImageDamage, DamagedHeaders) {
  const TemporaryFolder folder;
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"DimSize = 3 4 5", "DimSize = 3 4"},
           {"DimSize = 3 4 5", "DimSize = 3 4 -5"},
           {"DimSize = 3 4 5", "DimSize = 0 4 5"},
           {"DimSize = 3 4 5", "DimSize = 10000 10000 10000"},
           {"DimSize = 3 4 5", "DimSize = 4294967296 4294967296 4294967296"},
           {"DimSize = 3 4 5\n", ""},
           {"ElementSpacing = 2 3 4", "ElementSpacing = 2 3"},
           {"ElementSpacing = 2 3 4", "ElementSpacing = 2 3 nan"},
           {"ElementSpacing = 2 3 4", "ElementSpacing = 2 3 0"},
           {"Offset = 10 20 30", "Offset = 1e300 20 30"},
           {"1 0 0 0 1 0 0 0 1", "1 0 0 0 1 0 0 0"},
           {"1 0 0 0 1 0 0 0 1", "1 0 0 1 0 0 0 0 1"},
           {"MET_UCHAR", "MET_STRING"},
           {"MET_UCHAR", "MET_FLOAT_ARRAY"},
           {"NDims = 3\n", ""},
           {"NDims = 3\n", "NDims = 3\nNDims = 3\n"},
           {"NDims = 3\n", "NDims = 3\nHeaderSize = 99999999999999999999\n"},
           {"NDims = 3\n", "NDims = 3\nHeaderSize = 18446744073709551615\n"},
           {"NDims = 3\n", "NDims = 3\nno equals sign\n"},
       }) {
    error_of(folder.file("v.mha", replaced(metaimage_header(), from, to) + voxels));
  }
}

}  // namespace
}  // namespace tunica::test
