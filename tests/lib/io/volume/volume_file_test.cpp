#include "io/volume/builders.hpp"
#include "support/mutate.hpp"

#include <Eigen/LU>

#include <sys/stat.h>

namespace tunica::test {
namespace {

using testing::HasSubstr;

TEST(VolumeFile, WhatIsNoVolumeIsRefusedByContent) {
  const TemporaryFolder folder;
  const auto refuse = [&](const std::string& name, const std::string& bytes, const std::string& message) {
    EXPECT_THAT(error_of(folder.file(name, bytes)), HasSubstr(message));
  };
  refuse("v.nii", "", "is empty");
  refuse("v.nii.gz", deflated(""), "is empty");
  refuse("v.nii", "hello", "is not a volume");
  refuse("v.nii.gz", deflated("hello"), "is not a volume");
  refuse("v.nii", "ply\nformat ascii 1.0\n", "surface mesh");
  refuse("v.stl", std::string(84, '\0'), "surface mesh");
  refuse("v.dcm", std::string(128, '\0') + "DICM", "DICOM");
  refuse("v.h5", "\x89HDF\r\n\x1a\n", "HDF5");
  refuse("v.jpg", "\xff\xd8\xff\xe0", "not exact enough");
  EXPECT_THAT(error_of(folder / "missing.nii"), HasSubstr("no such file"));
}

TEST(VolumeFile, APipeIsRefusedAtOnce) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe.nii").c_str(), 0600), 0);
  EXPECT_THAT(error_of(folder / "pipe.nii"), HasSubstr("not a regular file"));
  folder.file("v.mhd", metaimage_header("MET_UCHAR", "", "pipe.nii"));
  EXPECT_THAT(error_of(folder / "v.mhd"), HasSubstr("not a regular file"));
  for (const char* slice : {"1.png", "1.tif"}) {
    const TemporaryFolder slices;
    ASSERT_EQ(::mkfifo((slices / slice).c_str(), 0600), 0);
    VolumeOptions options;
    options.spacing = Vec3(1, 1, 1);
    EXPECT_THAT(error_of(slices / "", options), HasSubstr("not a regular file"));
  }
}

TEST(VolumeFile, VoxelsThatNoScannerMakesAreWarnedOf) {
  const TemporaryFolder folder;
  const std::string voxels = encoded(sample_values<std::uint8_t>(60), Endian::little);
  for (const auto& [spacing, warned] :
       {std::pair("2e-5 2e-5 2e-5", true), {"2e-4 3e-4 4e-4", false}, {"50 2 3", false}, {"51 2 3", true}}) {
    const std::string header =
        replaced(metaimage_header(), "ElementSpacing = 2 3 4", std::string("ElementSpacing = ") + spacing);
    folder.file("v.mha", header + voxels);
    VolumeFile file = read_volume(folder / "v.mha", {});
    std::erase_if(file.warnings, [](const Warning& warning) { return warning.kind == "anisotropic voxels"; });
    ASSERT_EQ(file.warnings.size(), warned ? 1U : 0U) << spacing;
    EXPECT_TRUE(!warned || file.warnings[0].text.ends_with("mm: is their unit right?")) << file.warnings[0].text;
  }
}

TEST(VolumeFile, ThickSlicesAreWarnedOf) {
  const TemporaryFolder folder;
  for (const auto& [spacing, warned] : {std::pair("0.7 0.7 3", true), {"5 0.7 0.7", true}, {"1 1 2", false}}) {
    const std::string header =
        replaced(metaimage_header(), "ElementSpacing = 2 3 4", std::string("ElementSpacing = ") + spacing);
    folder.file("v.mha", header + std::string(60, '\1'));
    const VolumeFile file = read_volume(folder / "v.mha", {});
    ASSERT_EQ(file.warnings.size(), warned ? 1U : 0U) << spacing;
    if (warned) {
      EXPECT_EQ(file.warnings[0].kind, "anisotropic voxels");
      EXPECT_EQ(file.warnings[0].weight, Weight::minor);
      EXPECT_THAT(file.warnings[0].text,
                  HasSubstr(spacing[0] == '5' ? "half a slice, 2.5 mm" : "half a slice, 1.5 mm"));
    }
  }
}

TEST(VolumeFile, ASingleSliceIsWarnedOf) {
  const TemporaryFolder folder;
  const std::string header = replaced(metaimage_header(), "DimSize = 3 4 5", "DimSize = 12 1 5");
  const VolumeFile file = read_volume(folder.file("v.mha", header + std::string(60, '\1')), {});
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0].text, HasSubstr("12 x 1 x 5 voxels, a single slice"));
}

TEST(VolumeFile, VoxelsWithoutAHeaderNameTheOneBesideThem) {
  const TemporaryFolder folder;
  folder.file("v.raw", std::string(60, '\1'));
  EXPECT_THAT(error_of(folder / "v.raw"), HasSubstr("is not a volume"));
  folder.file("v.mhd", metaimage_header("MET_UCHAR", "", "v.raw"));
  EXPECT_THAT(error_of(folder / "v.raw"), HasSubstr("v.mhd, which is beside it"));
}

// Every damage of a good file is a clean refusal or a volume, in bounded memory and time.
TEST(VolumeFile, ThreeHundredDamagesOfEachFormat) {
  const TemporaryFolder folder;
  const std::string voxels = encoded(sample_values<std::uint8_t>(120), Endian::little);
  const std::vector<std::uint8_t> page(35, 3);
  NiftiOptions two;
  two.version = 2;
  two.endian = Endian::big;
  TiffOptions packed;
  packed.compression = 8;
  const std::vector<std::pair<std::string, std::string>> files{
      {"a.nii", nifti_file()},
      {"b.nii", nifti_file(two)},
      {"c.nii.gz", deflated(nifti_file())},
      {"d.nrrd", nrrd_header("int16", "endian: big\nencoding: raw\n") + voxels},
      {"e.nrrd", nrrd_header("uint8", "encoding: gzip\n") + deflated(voxels.substr(0, 60))},
      {"f.nrrd", nrrd_header("uint8", "encoding: ascii\n") + std::string(240, '1')},
      {"g.mha", metaimage_header("MET_SHORT") + voxels},
      {"h.mha", metaimage_header("MET_UCHAR", "CompressedData = True\n") + deflated(voxels.substr(0, 60), 15)},
      {"i.tif", tiff_file<std::uint8_t>(7, 5, {page, page, page})},
      {"j.tif", tiff_file<std::uint8_t>(7, 5, {page, page, page}, packed)},
      {"k.png", png_file(7, 5, page)},
  };
  std::size_t refused = 0;
  std::size_t read = 0;
  for (const auto& [name, bytes] : files) {
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      VolumeOptions options;
      if (name.ends_with("tif") || name.ends_with("png")) {
        options.spacing = Vec3(1, 1, 1);
      }
      try {
        const VolumeFile file = read_both_ways(folder.file(name, mutate(bytes, seed)), options);
        EXPECT_LE(file.volume.voxels(), 1000000U);
        ++read;
      } catch (const InputError& error) {
        EXPECT_TRUE(std::string(error.what()).starts_with((folder / "").string())) << error.what();
        ++refused;
      } catch (const UsageError&) {
        ++refused;  // damaged into another format, which brings its own spacing
      }
    }
  }
  EXPECT_GT(refused, 1000U);
  EXPECT_GT(read, 300U);
}

// The real volumes, by the facts of their README.
TEST(SharedVolumes, HeadersAreUnderstood) {
  const std::filesystem::path folder = std::filesystem::path(TUNICA_SHARED_DATA) / "volumes";
  if (!std::filesystem::exists(folder)) {
    GTEST_SKIP() << folder << " is absent";
  }
  struct Fact {
    std::string name, orientation, datatype;
    std::array<std::size_t, 3> dims;
    double determinant;
  };
  for (const Fact& fact : std::vector<Fact>{
           {"ts_aorta_dissection.nii.gz", "LPS", "uint8", {120, 126, 164}, 3.375},
           {"ts_abdomen_multilabel.nii.gz", "RAS", "uint8", {122, 101, 30}, 27},
           {"nv_torso_5mm.nii.gz", "RAS", "uint8", {384, 320, 89}, 3.058},
           {"nv_lesion_oblique.nii.gz", "RAS", "uint8", {124, 160, 140}, 1},
           {"nvd_ct_pitch_oblique.nii.gz", "RAS", "uint8", {175, 248, 58}, 1.582},
           {"sio_thorax_10mm.seg.nrrd", "RAS", "uint8", {128, 128, 34}, 92.83},
           {"vmtk_aorta_levelset.mha", "RAS", "float32", {157, 393, 34}, 1.159},
       }) {
    const VolumeFile file = read_both_ways(folder / fact.name);
    EXPECT_EQ(file.orientation, fact.orientation) << fact.name;
    EXPECT_EQ(file.datatype, fact.datatype) << fact.name;
    EXPECT_EQ(file.volume.dims, fact.dims) << fact.name;
    EXPECT_NEAR(file.volume.affine.leftCols<3>().determinant(), fact.determinant, 1e-3 * fact.determinant) << fact.name;
  }
  EXPECT_EQ(read_both_ways(folder / "sio_thorax_10mm.seg.nrrd").volume.label_names.size(), 7U);
  EXPECT_THAT(error_of(folder / "sio_thorax_overlapping_4d.seg.nrrd"),
              HasSubstr("has 2 layers: choose one with --layer 0..1"));
}

}  // namespace
}  // namespace tunica::test
