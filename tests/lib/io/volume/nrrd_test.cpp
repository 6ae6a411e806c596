#include "io/volume/builders.hpp"

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
                                     {"left-anterior-superior", {1, -1, 1}},
                                     {"LPI", {1, 1, -1}},
                                     {"right-posterior-inferior-time", {-1, 1, -1}}}) {
    const std::string header = replaced(nrrd_header(), "left-posterior-superior", space);
    const VolumeFile file = read_both_ways(folder.file("v.nrrd", header + voxels));
    EXPECT_TRUE(file.volume.affine.isApprox(signs.asDiagonal() * sample_affine())) << space;
    EXPECT_THAT(file.warnings, IsEmpty());
  }
  const std::string turned = replaced(nrrd_header(), "left-posterior-superior", "SLA");
  const Eigen::Matrix<double, 3, 4> affine = read_both_ways(folder.file("v.nrrd", turned + voxels)).volume.affine;
  EXPECT_TRUE(affine.row(0).isApprox(sample_affine().row(1)) && affine.row(1).isApprox(-sample_affine().row(2)) &&
              affine.row(2).isApprox(sample_affine().row(0)));
  for (const std::string space : {"3D-right-handed", "scanner-xyz", "LRS", "left-posterior", "XYZ"}) {
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
  EXPECT_THAT(texts_of(file.warnings),
              ElementsAre(HasSubstr("placed by their spacings alone, with axes to the left, back and top")));
  const std::string with_space = replaced(header, "encoding", "space: RAS\nspace origin: (1,2,3)\nencoding");
  const VolumeFile turned = read_both_ways(folder.file("v.nrrd", with_space + voxels));
  EXPECT_THAT(texts_of(turned.warnings),
              ElementsAre(HasSubstr("by their spacings and the space origin, with axes of its space 'RAS'")));
  EXPECT_EQ(turned.volume.affine.col(3), Vec3(-1, -2, 3));
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
        "encoding: raw\nline skip: 99\n", "encoding: raw\nbyte skip: 18446744073709551615\n",
        "encoding: raw\nbyte skip: -0\n", "encoding: raw\nbyte skip: -18446744073709551615\n",
        "encoding: ascii\nbyte skip: -1\n"}) {
    error_of(folder.file("v.nrrd", nrrd_header("uint8", more) + voxels));
  }
}

// Teem counts them in what is inflated, from its end too: -1 - N leaves N bytes behind the voxels.
TEST(Nrrd, SkippedBytesFromTheEnd) {
  const TemporaryFolder folder;
  const auto expected = values_of(read_volume(folder.file("v.nrrd", nrrd_header() + voxels)).volume);
  for (const bool gzip : {false, true}) {
    const std::string coding = gzip ? "encoding: gzip\n" : "encoding: raw\n";
    const auto read = [&](const std::string& skip, const std::string& data) {
      folder.file("v.raw", "a line\n" + (gzip ? deflated(data) : data));
      const std::string header =
          nrrd_header("uint8", coding + "line skip: 1\nbyte skip: " + skip + "\ndata file: v.raw\n");
      const VolumeFile file = read_both_ways(folder.file("v.nhdr", header));
      EXPECT_THAT(file.warnings, testing::IsEmpty());
      return values_of(file.volume);
    };
    EXPECT_EQ(read("-1", "any header" + voxels), expected);
    EXPECT_EQ(read("-4", "any header" + voxels + "xyz"), expected);
    folder.file("v.raw", gzip ? deflated(voxels) : voxels);
    EXPECT_THAT(error_of(folder.file("v.nhdr", nrrd_header("uint8", coding + "byte skip: -2\ndata file: v.raw\n"))),
                HasSubstr("truncated: it holds 60 bytes, and 60 of voxels with 1 behind them"));
  }
}

TEST(Nrrd, AxisMinimaAreTheOriginWhereThereIsNone) {
  const TemporaryFolder folder;
  const std::string header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 3 4 5\nencoding: raw\n";
  const auto affine_of = [&](const std::string& more) {
    return read_both_ways(folder.file("v.nrrd", header + more + "\n" + voxels)).volume.affine;
  };
  // A cell begins half a spacing before its sample, a node at it; cells unless the file says otherwise.
  EXPECT_EQ(affine_of("spacings: 2 3 4\naxis mins: 10 20 30\n").col(3), Vec3(11, 21.5, 32));
  EXPECT_EQ(affine_of("spacings: 2 3 4\naxis mins: 10 20 30\ncenters: cell node node\n").col(3), Vec3(11, 20, 30));
  const auto from_both = affine_of("axis mins: 10 20 30\naxis maxs: 16 29 50\ncenterings: cell node cell\n");
  EXPECT_TRUE(from_both.isApprox((Eigen::Matrix<double, 3, 4>() << 2, 0, 0, 11, 0, 3, 0, 20, 0, 0, 4, 32).finished()));
  EXPECT_EQ(affine_of("spacings: 2 3 4\naxis mins: 10 nan 30\n").col(3), Vec3(0, 0, 0)) << "one is unknown";
  EXPECT_EQ(affine_of("spacings: 2 3 4\naxis mins: 1 2 3\nspace: LPS\nspace origin: (7,8,9)\n").col(3), Vec3(7, 8, 9));
  error_of(folder.file("v.nrrd", header + "spacings: 2 3 4\naxis mins: 10 20\n\n" + voxels));
}

TEST(Nrrd, AChannelBeforeThreeAxesOfSpace) {
  const TemporaryFolder folder;
  const auto file_of = [&](const std::string& sizes, int count) {
    return folder.file(
        "v.nrrd", "NRRD0004\ntype: uint8\ndimension: 4\nsizes: " + sizes + "\nspacings: nan 2 3 4\nencoding: raw\n\n" +
                      encoded(sample_values<std::uint8_t>(static_cast<std::size_t>(count)), Endian::little));
  };
  const VolumeFile file = read_both_ways(file_of("1 3 4 5", 60));
  EXPECT_EQ(file.volume.dims, (std::array<std::size_t, 3>{3, 4, 5}));
  EXPECT_EQ(file.spacing, Vec3(2, 3, 4));
  EXPECT_EQ(file.warnings[0].weight, Weight::note);
  EXPECT_THAT(file.warnings[0].text, HasSubstr("1 x 3 x 4 x 5: the leading 1 is taken as a channel"));
  EXPECT_THAT(error_of(file_of("2 3 4 5", 120)), AllOf(HasSubstr("looks like 2 channels"), HasSubstr("argmax")));
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
                                    HasSubstr("ribs (label 1 of layer 0), left lung (label 1 of layer 1)")));
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

// Two layers, of which voxel i holds 2 i and 2 i + 1.
std::string two_layers(const std::string& segments) {
  std::vector<std::uint8_t> both(120);
  for (std::size_t i = 0; i < both.size(); ++i) {
    both[i] = static_cast<std::uint8_t>(i);
  }
  return layered(segments) + deflated(encoded(both, Endian::little));
}

VolumeOptions segment(const std::string& name, std::optional<std::size_t> layer = {}) {
  VolumeOptions options;
  options.segment = name;
  options.layer = layer;
  return options;
}

TEST(NrrdSegments, ChooseTheirLayer) {
  const TemporaryFolder folder;
  // Slicer before 4.11 writes neither layers nor values: a layer each, the value 1.
  const std::string old = "Segment0_Extent:=0 2 0 3 0 4\nSegment0_Name:=ribs\nSegment1_ID:=Segment_2\n";
  const std::string crossed =
      "Segment0_Name:=ribs\nSegment0_Layer:=1\nSegment0_LabelValue:=3\n"
      "Segment1_Name:=left lung\nSegment1_Layer:=0\nSegment1_LabelValue:=5\n";
  const auto first_of = [&](const std::string& segments, const VolumeOptions& options) {
    return values_of(read_both_ways(folder.file("v.seg.nrrd", two_layers(segments)), options).volume)[0];
  };
  EXPECT_EQ(first_of(old, segment("ribs")), 0);
  EXPECT_EQ(first_of(old, segment("Segment_2")), 1) << "called by its identifier";
  EXPECT_EQ(first_of(crossed, segment("ribs")), 1);
  EXPECT_EQ(first_of(crossed, segment("left lung")), 0);
  EXPECT_EQ(first_of(crossed, segment("3")), 1) << "a value of one segment alone";
  EXPECT_EQ(first_of(crossed, segment("ribs", 1)), 1);
  EXPECT_EQ(first_of(old, segment("1", 1)), 1) << "a value and a layer";
  const auto path = folder.file("v.seg.nrrd", two_layers(old));
  EXPECT_THAT(error_of(path, segment("Segment_2", 0)),
              HasSubstr("--layer 0 does not hold the segment 'Segment_2', which is in layer 1"));
  EXPECT_THAT(error_of(path, segment("1")),
              AllOf(HasSubstr("segments in several layers"), HasSubstr("ribs (label 1 of layer 0)")));
  EXPECT_THAT(error_of(path, segment("rib")), HasSubstr("has no segment 'rib'"));
  EXPECT_THAT(error_of(path, segment("ribs+Segment_2")), HasSubstr("one of them, for a surface is made of one layer"));
  EXPECT_EQ(first_of("Segment0_Name:=a+b\nSegment1_Name:=b\n", segment("a+b")), 0);
  EXPECT_EQ(
      first_of("Segment0_Name:=a\nSegment1_Name:=b\nSegment1_Layer:=0\nSegment1_LabelValue:=2\n", segment("a + b")), 0);
}

TEST(NrrdSegments, ThatSayNoLayerOrNoNumber) {
  const TemporaryFolder folder;
  const auto path = folder.file("v.seg.nrrd", two_layers("Segment5_Name:=ribs\n"));
  EXPECT_THAT(error_of(path, segment("ribs")), HasSubstr("does not say in which of its 2 layers the segment ribs is"));
  for (const char* line : {"Segment0_Layer:=-1\n", "Segment0_LabelValue:=one\n"}) {
    EXPECT_THAT(error_of(folder.file("v.seg.nrrd", two_layers(line))), HasSubstr("has no such number"));
  }
}

TEST(NrrdSegments, OfOneValueAreToldWithTheirNames) {
  const TemporaryFolder folder;
  const std::string header =
      replaced(nrrd_header(), "encoding: raw\n", "encoding: raw\nSegment0_Name:=ribs\nSegment1_Name:=lung\n");
  const VolumeFile file = read_both_ways(folder.file("v.seg.nrrd", header + voxels), segment("ribs"));
  EXPECT_THAT(texts_of(file.warnings), ElementsAre(HasSubstr("the label 1 is called 'lung' and 'ribs'")));
  EXPECT_EQ(file.segments.size(), 2U);
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
