#include "io_volume/builders.hpp"

namespace tunica::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

template <class T>
class NrrdType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t, std::int32_t,
                             std::uint64_t, std::int64_t, float, double>;
TYPED_TEST_SUITE(NrrdType, Types);

TYPED_TEST(NrrdType, EveryNameEndianAndEncoding) {
  const TemporaryFolder folder;
  const std::array<std::vector<std::string>, 10> names{
      {{"uchar", "unsigned char", "uint8", "uint8_t"},
       {"signed char", "int8", "int8_t"},
       {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"},
       {"short", "short int", "signed short", "signed short int", "int16", "int16_t"},
       {"uint", "unsigned int", "uint32", "uint32_t"},
       {"int", "signed int", "int32", "int32_t"},
       {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"},
       {"longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"},
       {"float"},
       {"double"}}};
  const auto values = sample_values<TypeParam>(60);
  for (const std::string& name : names.at(Volume::Data(values).index())) {
    for (const Endian endian : {Endian::little, Endian::big}) {
      const std::string more = endian == Endian::big ? "endian: big\n" : "endian: little\n";
      const std::string bytes = encoded(values, endian);
      std::string text;
      for (const auto value : values) {
        text += std::to_string(value) + "\n";
      }
      for (const std::string& file : {nrrd_header(name, more + "encoding: raw\n") + bytes,
                                      nrrd_header(name, more + "encoding: gzip\n") + deflated(bytes),
                                      nrrd_header(name, more + "encoding: ascii\n") + text}) {
        const VolumeFile read = read_both_ways(folder.file("v.nrrd", file));
        EXPECT_EQ(std::get<std::vector<TypeParam>>(read.volume.data), values);
        EXPECT_TRUE(read.volume.affine.isApprox(sample_affine()));
        EXPECT_EQ(read.orientation, "LPS");
        EXPECT_EQ(read.format, "NRRD");
        EXPECT_THAT(read.warnings, IsEmpty());
      }
    }
  }
}

TEST(Nrrd, EverySpace) {
  const TemporaryFolder folder;
  for (const auto& [space, signs] : {std::pair<std::string, Vec3>{"LPS", {1, 1, 1}},
                                     {"right-anterior-superior", {-1, -1, 1}},
                                     {"RAS", {-1, -1, 1}},
                                     {"LAS", {1, -1, 1}},
                                     {"left-anterior-superior", {1, -1, 1}}}) {
    const std::string header = replaced(nrrd_header(), "left-posterior-superior", space);
    const VolumeFile file = read_both_ways(folder.file("v.nrrd", header + voxels));
    EXPECT_TRUE(file.volume.affine.isApprox(signs.asDiagonal() * sample_affine())) << space;
    EXPECT_THAT(file.warnings, IsEmpty());
  }
  for (const std::string space : {"3D-right-handed", "scanner-xyz"}) {
    const std::string header = replaced(nrrd_header(), "left-posterior-superior", space);
    EXPECT_THAT(texts_of(read_both_ways(folder.file("v.nrrd", header + voxels)).warnings),
                ElementsAre(HasSubstr(space)));
  }
}

TEST(Nrrd, SpacingsWhenThereAreNoDirections) {
  const TemporaryFolder folder;
  const std::string header = "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 3 4 5\nspacings: 2 3 4\nencoding: raw\n\n";
  const VolumeFile file = read_both_ways(folder.file("v.nrrd", header + voxels));
  EXPECT_EQ(file.spacing, Vec3(2, 3, 4));
  EXPECT_THAT(texts_of(file.warnings), ElementsAre(HasSubstr("placed by their spacings alone")));
  const auto warnings_of = [&](const std::string& spacings) {
    return texts_of(
        read_both_ways(folder.file("u.nrrd", replaced(header, "spacings: 2 3 4\n", spacings) + voxels)).warnings);
  };
  EXPECT_THAT(warnings_of("spacings: nan 3 4\n"), ElementsAre(HasSubstr("spacings (1 of 3 unknown: 1 mm)")));
  EXPECT_THAT(warnings_of("spacings: nan nan nan\n"), ElementsAre(HasSubstr("number (spacing 1 mm)")));
  EXPECT_THAT(warnings_of(""), ElementsAre(HasSubstr("number (spacing 1 mm)")));
}

TEST(Nrrd, UnitsOfLength) {
  const TemporaryFolder folder;
  const std::string more = "space units: \"um\" \"um\" \"um\"\nencoding: raw\n";
  EXPECT_TRUE(read_both_ways(folder.file("v.nrrd", nrrd_header("uint8", more) + voxels))
                  .volume.affine.isApprox(0.001 * sample_affine()));
  const std::string mixed = "space units: \"um\" \"mm\" \"um\"\nencoding: raw\n";
  EXPECT_THAT(error_of(folder.file("v.nrrd", nrrd_header("uint8", mixed) + voxels)), HasSubstr("units"));
}

TEST(Nrrd, DetachedData) {
  const TemporaryFolder folder;
  const std::string header = nrrd_header("uint8", "encoding: raw\ndata file: v.raw\n");
  folder.file("v.raw", voxels);
  for (const std::string& text : {header, header.substr(0, header.size() - 1), header.substr(0, header.size() - 2)}) {
    const VolumeFile file = read_both_ways(folder.file("v.nhdr", text));
    EXPECT_EQ(values_of(file.volume)[7], 22);
    EXPECT_THAT(file.data_files, ElementsAre(folder / "v.raw"));
  }
  folder.file("v.raw", voxels.substr(0, 20));
  EXPECT_THAT(error_of(folder / "v.nhdr"), AllOf(HasSubstr("v.raw"), HasSubstr("40 of the 60 bytes")));
  std::filesystem::remove(folder / "v.raw");
  EXPECT_THAT(error_of(folder / "v.nhdr"), AllOf(HasSubstr("v.nhdr: "), HasSubstr("v.raw is missing")));
  for (const std::string name : {"/etc/passwd", "../v.raw", "a/../../v.raw"}) {
    const std::string text = nrrd_header("uint8", "encoding: raw\ndata file: " + name + "\n");
    EXPECT_THAT(error_of(folder.file("v.nhdr", text)), HasSubstr("not in the header's own folder"));
  }
  for (const std::string name : {"LIST", "LIST\nv0.raw\nv1.raw", "slice%03d.raw 0 4 1"}) {
    const std::string text = nrrd_header("uint8", "encoding: raw\ndata file: " + name + "\n");
    EXPECT_THAT(error_of(folder.file("v.nhdr", text)), HasSubstr("several data files"));
  }
}

TEST(Nrrd, SkippedLinesAndBytes) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& more, const std::string& data) {
    return values_of(read_both_ways(folder.file("v.nrrd", nrrd_header("uint8", more) + data)).volume);
  };
  const auto expected = read("encoding: raw\n", voxels);
  EXPECT_EQ(read("encoding: raw\nline skip: 2\nbyte skip: 3\n", "a\nb\nxyz" + voxels), expected);
  EXPECT_EQ(read("encoding: raw\nbyte skip: -1\n", "any header" + voxels), expected);
  EXPECT_EQ(read("encoding: gzip\nline skip: 1\nbyte skip: 3\n", "a\n" + deflated("xyz" + voxels)), expected);
  for (const std::string more :
       {"encoding: raw\nbyte skip: -2\n", "encoding: raw\nbyte skip: x\n", "encoding: gzip\nbyte skip: -1\n",
        "encoding: raw\nline skip: 99\n", "encoding: raw\nbyte skip: 18446744073709551615\n"}) {
    error_of(folder.file("v.nrrd", nrrd_header("uint8", more) + voxels));
  }
}

std::string layered(const std::string& more = {}) {
  return "NRRD0004\ntype: uint8\ndimension: 4\nspace: LPS\nsizes: 2 3 4 5\n"
         "space directions: none (2,0,0) (0,3,0) (0,0,4)\nkinds: list domain domain domain\nspace origin: (10,20,30)\n"
         "encoding: gzip\n" +
         more + "\n";
}

TEST(Nrrd, OverlappingSegmentsNeedALayer) {
  const TemporaryFolder folder;
  const std::string segments =
      "Segment0_ID:=Segment_1\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Name:=ribs\n"
      "Segment1_LabelValue:=1\nSegment1_Layer:=1\nSegment1_Name:=left lung\n";
  std::vector<std::uint8_t> both(120);
  for (std::size_t i = 0; i < both.size(); ++i) {
    both[i] = static_cast<std::uint8_t>(i);
  }
  const auto path = folder.file("v.seg.nrrd", layered(segments) + deflated(encoded(both, Endian::little)));
  EXPECT_THAT(error_of(path), AllOf(HasSubstr("has 2 layers: choose one with --layer 0..1"),
                                    HasSubstr("layer 0 holds ribs; layer 1 holds left lung")));
  for (std::size_t layer = 0; layer < 2; ++layer) {
    VolumeOptions options;
    options.layer = layer;
    const VolumeFile file = read_both_ways(path, options);
    for (std::size_t i = 0; i < 60; ++i) {
      EXPECT_EQ(values_of(file.volume)[i], static_cast<double>(2 * i + layer));
    }
    EXPECT_THAT(file.volume.label_names, ElementsAre(std::pair(1.0, layer == 0 ? "ribs" : "left lung")));
    EXPECT_EQ(file.layers, 2U);
    EXPECT_TRUE(file.volume.affine.isApprox(sample_affine()));
  }
  VolumeOptions options;
  options.layer = 2;
  EXPECT_THAT(error_of(path, options), HasSubstr("--layer 2 does not exist"));
}

TEST(Nrrd, TimeNeedsAFrame) {
  const TemporaryFolder folder;
  const std::string header =
      "NRRD0004\ntype: uint8\ndimension: 4\nspace: LPS\nsizes: 3 4 5 2\n"
      "space directions: (2,0,0) (0,3,0) (0,0,4) none\nkinds: domain domain domain time\nspace origin: (10,20,30)\n"
      "encoding: raw\n\n";
  std::string both = voxels + voxels;
  both[60] = 77;
  const auto path = folder.file("v.nrrd", header + both);
  EXPECT_THAT(error_of(path), HasSubstr("has 2 frames: choose one with --frame 0..1"));
  VolumeOptions options;
  options.frame = 1;
  EXPECT_EQ(values_of(read_both_ways(path, options).volume)[0], 77);
  const std::string bare =
      "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 4 5 2\nspacings: 2 3 4 nan\nencoding: raw\n\n";
  EXPECT_EQ(values_of(read_both_ways(folder.file("v.nrrd", bare + both), options).volume)[0], 77);
}

TEST(Nrrd, WhatIsNoScalarVolumeIsRefused) {
  const TemporaryFolder folder;
  const auto refuse = [&](const std::string& header, const std::string& message) {
    EXPECT_THAT(error_of(folder.file("v.nrrd", header + std::string(400, 'x'))), HasSubstr(message));
  };
  refuse(replaced(layered(), "kinds: list", "kinds: RGB-color"), "2 values per voxel (kind rgb-color)");
  refuse(replaced(nrrd_header(), "encoding: raw", "encoding: bzip2"), "encoding is 'bzip2'");
  refuse(replaced(nrrd_header(), "encoding: raw", "encoding: hex"), "encoding is 'hex'");
  refuse(nrrd_header("block"), "type 'block'");
  refuse(nrrd_header("int16"), "no field 'endian'");
  refuse(nrrd_header("int16", "encoding: raw\nendian: middle\n"), "endian");
  refuse("NRRD0004\ntype: uint8\ndimension: 2\nsizes: 3 4\nspacings: 1 1\nencoding: raw\n\n", "2 axes in space");
  refuse(replaced(nrrd_header(), "(0,3,0)", "none"), "2 axes in space");
}

TEST(NrrdDamage, DamagedHeaders) {
  const TemporaryFolder folder;
  const std::string header = nrrd_header();
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"sizes: 3 4 5", "sizes: 3 4"},
           {"sizes: 3 4 5", "sizes: 3 4 0"},
           {"sizes: 3 4 5", "sizes: 3 4 -5"},
           {"sizes: 3 4 5", "sizes: 99999999999999999999 4 5"},
           {"sizes: 3 4 5", "sizes: 10000 10000 10000"},
           {"sizes: 3 4 5", "sizes: 4294967296 4294967296 4294967296"},
           {"sizes: 3 4 5\n", ""},
           {"dimension: 3", "dimension: 0"},
           {"dimension: 3", "dimension: 99999999"},
           {"dimension: 3", "dimension: three"},
           {"(2,0,0)", "(2,0)"},
           {"(2,0,0)", "(2,0,x)"},
           {"(2,0,0)", "(nan,0,0)"},
           {"(2,0,0)", "(0,0,0)"},
           {"(2,0,0)", "(0,0,8)"},
           {"(2,0,0)", "(1e300,0,0)"},
           {"(2,0,0) ", ""},
           {"(10,20,30)", "(10,20"},
           {"(10,20,30)", "10 20 30"},
           {"(10,20,30)", "(1,2,inf)"},
           {"kinds: domain domain domain", "kinds: domain"},
           {"encoding: raw\n", ""},
           {"type: uint8\n", ""},
           {"type: uint8\n", "type: uint8\ntype: uint16\n"},
           {"type: uint8\n", "type: uint8\ngarbage\n"},
       }) {
    error_of(folder.file("v.nrrd", replaced(header, from, to) + voxels));
  }
}

TEST(NrrdDamage, TruncatedAnywhere) {
  const TemporaryFolder folder;
  const std::string raw = nrrd_header() + voxels;
  for (std::size_t size = 1; size < raw.size(); ++size) {
    const std::string message = error_of(folder.file("v.nrrd", raw.substr(0, size)));
    if (size >= raw.size() - 60) {
      EXPECT_THAT(message, HasSubstr("truncated: "));
      EXPECT_THAT(message, HasSubstr(std::to_string(raw.size() - size) + " of the 60 bytes"));
    }
  }
  const std::string gzip = nrrd_header("uint8", "encoding: gzip\n") + deflated(voxels);
  for (std::size_t size = gzip.size() - 60; size < gzip.size(); ++size) {
    EXPECT_THAT(error_of(folder.file("v.nrrd", gzip.substr(0, size))), HasSubstr("truncated"));
  }
  const std::string text = nrrd_header("uint8", "encoding: text\n") + "1 2 3";
  EXPECT_THAT(error_of(folder.file("v.nrrd", text)), HasSubstr("truncated: "));
  std::string numbers;
  for (int i = 0; i < 59; ++i) {
    numbers += "12 ";
  }
  EXPECT_THAT(error_of(folder.file("v.nrrd", nrrd_header("uint8", "encoding: text\n") + numbers)),
              HasSubstr("1 of the 60 numbers"));
  EXPECT_THAT(error_of(folder.file("v.nrrd", nrrd_header("uint8", "encoding: text\n") + numbers + "256")),
              HasSubstr("'256'"));
}

}  // namespace
}  // namespace tunica::test
