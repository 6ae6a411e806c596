#include "tunica/io/volume/label_names.hpp"

#include "io/volume/builders.hpp"
#include "support/mutate.hpp"

namespace tunica::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

const std::string bids = "index\tname\tcolor\n1\taorta\t#ff0000\n52\tleft atrium\t#00ff00\n3\tn/a\t#000000\n";
const std::string itk_snap =
    "################################################\n# ITK-SnAP Label Description File\n"
    "    0     0    0    0        0  0  0    \"Clear Label\"\n"
    "    1   255    0    0        1  1  1    \"aorta\"\n   52     0  255    0        1  1  1    \"left atrium\"\n";
const std::string slicer =
    "# Color table file segments.ctbl\n# 2 values\n0 Background 0 0 0 0\n1 aorta 128 174 128 255\n"
    "52 left atrium 241 214 145 255\n";
const std::string freesurfer =
    "#No. Label Name:                            R   G   B   A\r\n\r\n"
    "0   Unknown                                 0   0   0   0\r\n"
    "2   Left-Cerebral-White-Matter              245 245 245 0\r\n";
const std::string slicer_csv = "LabelValue,Name,Color_R,Color_G,Color_B,Color_A\n1,aorta,1,2,3,255\n";

std::string xml_of(const std::string& labels) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?> <CaretExtension>  <Date><![CDATA[2013-07-14]]></Date>   "
         "<VolumeInformation Index=\"0\">   <LabelTable>" +
         labels + "  </LabelTable>  <VolumeType><![CDATA[Label]]></VolumeType>   </VolumeInformation></CaretExtension>";
}

const std::string two_labels =
    "<Label Key=\"1\" Red=\"0.2\" Green=\"0.5\" Blue=\"0.1\" Alpha=\"1\"><![CDATA[aorta]]></Label>"
    "<Label Key=\"52\" Red=\"0.2\">left &amp; right</Label>";

// A NIfTI file with a header extension of that code and content.
std::string extended(const std::string& content, std::int32_t code = 0, int version = 1, Endian endian = Endian::little,
                     std::optional<std::int32_t> stated = {}) {
  std::string padded = content;
  padded.resize((content.size() + 8 + 15) / 16 * 16 - 8, '\0');
  NiftiOptions options;
  options.version = version;
  options.endian = endian;
  const auto size = static_cast<std::int32_t>(padded.size() + 8);
  options.vox_offset = (version == 1 ? 352 : 544) + size;
  std::string file = nifti_file(options);
  const std::size_t header = version == 1 ? 348 : 540;
  file[header] = 1;
  file.insert(header + 4, encoded(stated.value_or(size), endian) + encoded(code, endian) + padded);
  return file;
}

class LabelTables : public ::testing::Test {
protected:
  std::string error_in(const std::string& text) {
    const auto path = folder.file("labels.txt", text);
    try {
      read_label_names(path);
    } catch (const InputError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with(path.string())) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "read without error: " << text.substr(0, 80);
    return {};
  }

  TemporaryFolder folder;
};

TEST_F(LabelTables, AreToldByTheirContent) {
  const auto read = [&](const std::string& text) { return read_label_names(folder.file("any.name", text)); };
  EXPECT_THAT(read(bids), ElementsAre(Pair(1, "aorta"), Pair(52, "left atrium")));
  EXPECT_THAT(read("\xef\xbb\xbf" + bids), ElementsAre(Pair(1, "aorta"), Pair(52, "left atrium")));
  EXPECT_THAT(read("name\tindex\r\n\"aorta\"\t1\r\n"), ElementsAre(Pair(1, "aorta")));
  EXPECT_THAT(read(itk_snap), ElementsAre(Pair(0, "Clear Label"), Pair(1, "aorta"), Pair(52, "left atrium")));
  EXPECT_THAT(read(slicer), ElementsAre(Pair(0, "Background"), Pair(1, "aorta"), Pair(52, "left atrium")));
  EXPECT_THAT(read(freesurfer), ElementsAre(Pair(0, "Unknown"), Pair(2, "Left-Cerebral-White-Matter")));
  EXPECT_THAT(read(slicer_csv), ElementsAre(Pair(1, "aorta")));
  EXPECT_THAT(read("name,index\n \"aorta, \"\"arch\"\"\" ,1\r\n\"open,2\n"),
              ElementsAre(Pair(1, "aorta, \"arch\""), Pair(2, "\"open")));
  EXPECT_THAT(read("7 colon\n-8 Area 4 255 0 0 0"), ElementsAre(Pair(7, "colon"), Pair(-8, "Area 4")));
}

// Each character of ASCII or Latin-1 as two bytes, after the mark.
std::string utf16(const std::string& latin_1, Endian endian) {
  std::string bytes = encoded<std::uint16_t>(0xfeff, endian);
  for (const char c : latin_1) {
    bytes += encoded<std::uint16_t>(static_cast<unsigned char>(c), endian);
  }
  return bytes;
}

TEST_F(LabelTables, MayBeInLatin1OrUtf16) {
  const auto read = [&](const std::string& text) { return read_label_names(folder.file("any.name", text)); };
  const std::string latin_1 = "index\tname\n1\tArt\xe8re f\xe9morale\n2\tc\x9cur\n";
  EXPECT_THAT(read(latin_1), ElementsAre(Pair(1, "Artère fémorale"), Pair(2, "cœur")));
  EXPECT_THAT(read("index\tname\n1\tArtère fémorale\n"), ElementsAre(Pair(1, "Artère fémorale"))) << "UTF-8 already";
  for (const Endian endian : {Endian::little, Endian::big}) {
    EXPECT_THAT(read(utf16("index;name\r\n1;V\xe4ne\r\n", endian)), ElementsAre(Pair(1, "Väne")));
    std::string outside = utf16("1 ", endian);
    for (const int unit : {0xd83e, 0xdec0}) {
      outside += encoded(static_cast<std::uint16_t>(unit), endian);
    }
    EXPECT_THAT(read(outside), ElementsAre(Pair(1, "\xf0\x9f\xab\x80"))) << "a pair: the anatomical heart";
    EXPECT_THAT(error_in(outside.substr(0, outside.size() - 2)), HasSubstr("UTF-16 text that is damaged at byte 6"));
    EXPECT_THAT(error_in(outside.substr(0, outside.size() - 1)), HasSubstr("UTF-16 text that is damaged"));
  }
  EXPECT_THAT(error_in(utf16("1 aorta\n", Endian::little).substr(2)), HasSubstr("save it as UTF-8"));
}

TEST_F(LabelTables, MayHaveAnySeparatorAndNamesWithOneInThem) {
  const auto read = [&](const std::string& text) { return read_label_names(folder.file("any.name", text)); };
  EXPECT_THAT(read("Label;Name;Farbe\n1;aorta;#ff0000\n2;left, right;#00ff00\n"),
              ElementsAre(Pair(1, "aorta"), Pair(2, "left, right")));
  EXPECT_THAT(read("index,name\n1,atrium, left\n2,aorta,,\n"), ElementsAre(Pair(1, "atrium, left"), Pair(2, "aorta")));
  EXPECT_THAT(read("name,index,r,g,b\natrium, left,1,255,0,0\n"), ElementsAre(Pair(1, "atrium, left")));
  EXPECT_THAT(read("1;aorta\n2;atrium, left\n"), ElementsAre(Pair(1, "aorta"), Pair(2, "atrium, left")));
  EXPECT_THAT(read("1,aorta,255,0,0\n2,atrium, left,1,2,3\n"), ElementsAre(Pair(1, "aorta"), Pair(2, "atrium, left")));
  EXPECT_THAT(read("index,name\n1.0,aorta\n"), ElementsAre(Pair(1, "aorta"))) << "as pandas writes them";
  EXPECT_THAT(read("index,label,name\n1,1,A\n2,2,B\n"), ElementsAre(Pair(1, "A"), Pair(2, "B")));
  EXPECT_THAT(error_in("index,label,name\n0,1,A\n1,2,B\n"), HasSubstr("\"index\" says 0, another one 1"))
      << "as data frames are written";
  EXPECT_THAT(error_in("index,name,notes\n1,atrium,left,seen twice\n"),
              HasSubstr(":2: the row has 4 cells between ',', the heading 3: put a name with ',' in it in quotes"));
  EXPECT_THAT(error_in("index\tname\n1\taorta\tx\n"), HasSubstr("the row has 3 cells between 'tab'"));
  EXPECT_THAT(error_in("aorta;1\n"), HasSubstr("begins with their names, index and name"));
}

TEST_F(LabelTables, MayBeJson) {
  const auto read = [&](const std::string& text) { return read_label_names(folder.file("any.name", text)); };
  const auto two = ElementsAre(Pair(1, "aorta"), Pair(2, "left atrium"));
  EXPECT_THAT(read(R"({"1": "aorta", "2": "left atrium"})"), two);
  EXPECT_THAT(read(R"( {"aorta": 1, "left atrium": "2"})"), two);
  EXPECT_THAT(read(R"([{"value": 1, "name": "aorta"}, {"name": "left atrium", "value": 2}])"), two);
  EXPECT_THAT(read(R"([{"id": 1, "name": "aorta"}, {"label": "2", "name": "left atrium", "color": [1, 2]}])"), two);
  EXPECT_THAT(read(R"({"1": {"name": "aorta"}, "2": {"name": "left atrium"}})"), two);
  EXPECT_THAT(read(R"({"name": "set", "labels": {"aorta": 1, "left atrium": 2, "both": [1, 2]}, "numTraining": 7})"),
              two);
  EXPECT_THAT(read(R"({"labels": {"1": "aorta", "2": "left atrium"}})"), two);
  EXPECT_THAT(read(R"({"labels": {"aorta": [1], "left atrium": 2}})"), two);
  LabelUnions unions;
  const auto regions = folder.file("dataset.json", R"({"labels": {"background": 0, "whole": [1, 2, 3], "core": [3]}})");
  EXPECT_THAT(read_label_names(regions, &unions), ElementsAre(Pair(0, "background"), Pair(3, "core")));
  EXPECT_THAT(unions, ElementsAre(Pair("whole", "1+2+3")));
  EXPECT_THAT(error_in(R"({"labels": {"aorta": 1, "both": [1, "x"]}})"), HasSubstr("'both' lists"));
  EXPECT_THAT(read(R"({"segmentAttributes": [[{"labelID": 1, "SegmentLabel": "aorta"}],)"
                   R"([{"labelID": 2, "SegmentLabel": "left atrium"}]]})"),
              two);
  EXPECT_THAT(read(utf16(R"({"1": "V\u00e4ne"})", Endian::little)), ElementsAre(Pair(1, "Väne")));
  EXPECT_THAT(error_in(R"({"1": "aorta", "1": "vein"})"), HasSubstr("has the key '1' twice"));
  EXPECT_THAT(error_in(R"({"1": "aorta")"), HasSubstr("is not JSON"));
  EXPECT_THAT(error_in(R"({"Modality": "MR", "EchoTime": 0.03})"), HasSubstr("Modality"));
  EXPECT_THAT(error_in(R"({"aorta": 1.5})"), HasSubstr("neither a name nor a label"));
  EXPECT_THAT(error_in(R"(["aorta", "left atrium"])"), HasSubstr("its label names are wanted as"));
  EXPECT_THAT(error_in("[]"), HasSubstr("names no label"));
  EXPECT_THAT(error_in(std::string(100000, '[')), HasSubstr("nested deeper than 16"));
  EXPECT_THAT(error_in(R"({"1": "a\u0001b"})"), HasSubstr("control character"));
  EXPECT_THAT(error_in("{\"1\": \"" + std::string(201, 'a') + "\"}"), HasSubstr("201 bytes"));
}

TEST_F(LabelTables, WithSeveralNamesOfALabelAreTold) {
  EXPECT_FALSE(several_names("t.tsv", {{1, "aorta"}, {2, "vein"}, {1, "aorta"}}));
  const auto warning = several_names("t.tsv", {{1, "aorta"}, {2, "vein"}, {1, "trachea"}});
  ASSERT_TRUE(warning);
  EXPECT_THAT(warning->text, HasSubstr("t.tsv: the label 1 is called 'aorta' and 'trachea'"));
  const auto number = several_names("t.tsv", {{1, "2"}, {2, "vein"}});
  ASSERT_TRUE(number);
  EXPECT_THAT(number->text, HasSubstr("t.tsv: the label 1 is called '2', which is another label's number"));
  EXPECT_FALSE(several_names("t.tsv", {{1, "1"}, {2, "7"}}));
}

TEST_F(LabelTables, ThatAreNoneAreRefusedWithTheirLine) {
  EXPECT_THAT(error_in(""), HasSubstr("names no label"));
  EXPECT_THAT(error_in("# only a comment\n"), HasSubstr("names no label"));
  EXPECT_THAT(error_in("1 aorta 1 2 3 4\nsome notes on the scan\n"), HasSubstr(":2: is no line of a table"));
  EXPECT_THAT(error_in("1 255 0 0 0\n"), HasSubstr(":1: is no line of a table"));
  EXPECT_THAT(error_in("1 0 0 0 1 1 1 \"aorta\n"), HasSubstr(":1: is no line of a table"));
  EXPECT_THAT(error_in("99999999999999999999 aorta\n"), HasSubstr(":1: is no line of a table"));
  EXPECT_THAT(error_in("index\tname\none\taorta\n"), HasSubstr(":2: 'one' is no label value"));
  EXPECT_THAT(error_in("index\tname\n1.5\taorta\n"), HasSubstr(":2: '1.5' is no label value"));
  EXPECT_THAT(error_in("index\tname\n\taorta\n"), HasSubstr(":2: the row is shorter"));
  EXPECT_THAT(error_in("index\tname\n1\n"), HasSubstr(":2: the row is shorter"));
  EXPECT_THAT(error_in(bids + std::string("\0", 1)), HasSubstr("binary"));
  EXPECT_THAT(error_in("1 \"a\x01"
                       "b\"\n"),
              HasSubstr("control character"));
  EXPECT_THAT(error_in("1 " + std::string(201, 'a') + "\n"), HasSubstr("201 bytes"));
  EXPECT_THAT(error_in(std::string((std::size_t{16} << 20) + 1, '#')), HasSubstr("16 MiB"));
  std::string many;
  for (int label = 0; label <= 65536; ++label) {
    many += std::to_string(label) + " x\n";
  }
  EXPECT_THAT(error_in(many), HasSubstr("more than 65536 labels"));
  EXPECT_THROW(read_label_names(folder / "absent.tsv"), InputError);
  EXPECT_THROW(read_label_names(folder / ""), InputError);
}

TEST_F(LabelTables, DamagedOnesAreReadOrRefused) {
  std::size_t refused = 0;
  const std::string json = R"({"labels": {"aorta": 1, "left atrium": 2, "both": [1, 2]}})";
  for (const std::string& text :
       {bids, itk_snap, slicer, freesurfer, slicer_csv, json, utf16(bids, Endian::big), utf16(json, Endian::little)}) {
    for (std::uint64_t seed = 0; seed < 400; ++seed) {
      try {
        EXPECT_FALSE(read_label_names(folder.file("labels.txt", mutate(text, seed))).empty());
      } catch (const InputError&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 100U);
}

TEST_F(LabelTables, BesideAVolumeHaveItsStem) {
  for (const char* name : {"scan.tsv", "scan.txt", "scan.nii.gz.txt", "other.tsv"}) {
    folder.file(name, bids);
  }
  const auto found = label_tables_beside(folder / "scan.nii.gz");
  EXPECT_THAT(found, ElementsAre(folder / "scan.tsv", folder / "scan.txt"));
  EXPECT_EQ(label_tables_beside(folder / "scan/").size(), 2U) << "a folder of slices";
  EXPECT_TRUE(label_tables_beside(folder / "absent.nii").empty());
}

TEST(LabelNamesTest, AreFoundByValueOrName) {
  const LabelNames names{{1, "aorta"}, {2, "colon"}, {3, "aorta"}, {2, "bowel"}, {4, ""}};
  EXPECT_EQ(find_label(names, "2"), 2);
  EXPECT_EQ(find_label(names, "9"), 9) << "a value needs no name";
  EXPECT_EQ(find_label(names, "9007199254740992"), 0x1p53);
  EXPECT_EQ(find_label(names, "-7"), -7);
  EXPECT_EQ(find_label(names, "007"), 7);
  for (const char* beyond : {"9007199254740993", "18446744073709551615", "-9007199254740993"}) {
    EXPECT_THROW(find_label(names, beyond), InputError) << beyond;
  }
  EXPECT_EQ(find_label(names, "colon"), 2);
  EXPECT_EQ(find_label(names, "bowel"), 2) << "a label may have two names";
  EXPECT_EQ(find_label(names, "liver"), std::nullopt);
  try {
    find_label(names, "aorta");
    ADD_FAILURE() << "two labels of one name";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'aorta' is the name of two labels, 1 and 3"));
  }
  EXPECT_EQ(nearest_label(names, "Colon"), "colon");
  EXPECT_EQ(nearest_label(names, "colno"), "colon");
  EXPECT_EQ(nearest_label(names, "kidney"), "");
  EXPECT_EQ(nearest_label(names, ""), "");
  EXPECT_EQ(nearest_label({}, "aorta"), "");
}

TEST(NiftiLabelNames, StandInAHeaderExtension) {
  const TemporaryFolder folder;
  for (const int version : {1, 2}) {
    for (const Endian endian : {Endian::little, Endian::big}) {
      for (const std::int32_t code : {0, 30}) {
        const std::string bytes = extended(xml_of(two_labels), code, version, endian);
        for (const std::string& stored : {bytes, deflated(bytes)}) {
          const VolumeFile file = read_both_ways(folder.file("v.nii", stored));
          EXPECT_THAT(file.volume.label_names, ElementsAre(Pair(1, "aorta"), Pair(52, "left & right")));
          EXPECT_TRUE(file.warnings.empty());
          EXPECT_EQ(values_of(file.volume), values_of(read_volume(folder.file("plain.nii", nifti_file())).volume));
        }
      }
    }
  }
}

TEST(NiftiLabelNames, OfAnotherExtensionAreNotLookedFor) {
  const TemporaryFolder folder;
  for (const auto& [content, code] : {std::pair{xml_of(two_labels), 6}, std::pair{std::string("a comment"), 0}}) {
    const VolumeFile file = read_both_ways(folder.file("v.nii", extended(content, code)));
    EXPECT_TRUE(file.volume.label_names.empty());
    EXPECT_TRUE(file.warnings.empty());
  }
}

TEST(NiftiLabelNames, DamagedOnesAreAWarningAndTheVoxelsAreRead) {
  const TemporaryFolder folder;
  const std::string bomb =
      "<!DOCTYPE x [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;&a;&a;\">]><LabelTable><Label "
      "Key=\"1\">&b;</Label></LabelTable>";
  for (const auto& [xml, why] : std::initializer_list<std::pair<std::string, const char*>>{
           {xml_of("<Label Key=\"one\">aorta</Label>"), "no number for its Key"},
           {xml_of("<Label>aorta</Label>"), "no number for its Key"},
           {xml_of("<Label Key=\"1\">" + std::string(300, 'a') + "</Label>"), "300 bytes"},
           {xml_of("<Label Key=\"1\">aorta"), "mismatched tag"},
           {xml_of(two_labels).substr(0, 300), "at byte"},
           {xml_of("<Label Key=\"1\">a\nb</Label>"), "control character"},
           {bomb, "document type"}}) {
    const VolumeFile file = read_both_ways(folder.file("v.nii", extended(xml)));
    ASSERT_EQ(file.warnings.size(), 1U) << xml;
    EXPECT_THAT(file.warnings[0].text, HasSubstr(why));
  }
  // Sizes that no extension has: there is none.
  for (const std::int32_t size : {0, -1, 7, 2147483647, -2147483647 - 1}) {
    const auto bytes = extended(xml_of(two_labels), 0, 1, Endian::little, size);
    EXPECT_TRUE(read_both_ways(folder.file("v.nii", bytes)).volume.label_names.empty()) << size;
  }
}

TEST(NiftiLabelNames, HostileExtensionsAreReadOrRefused) {
  const TemporaryFolder folder;
  const std::string bytes = extended(xml_of(two_labels));
  for (std::uint64_t seed = 0; seed < 1500; ++seed) {
    std::string text = bytes;
    const std::string damaged = mutate(std::string_view(bytes).substr(348, text.size() - 348 - 60), seed);
    text.replace(348, text.size() - 348 - 60, damaged);
    try {
      read_volume(folder.file("v.nii", text));
    } catch (const InputError&) {
    }
  }
}

}  // namespace
}  // namespace tunica::test
