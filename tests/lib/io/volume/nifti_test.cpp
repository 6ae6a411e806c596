#include "io/volume/builders.hpp"

#include <Eigen/Geometry>

namespace tunica::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;

// NIfTI's world is RAS, tunica's LPS.
Eigen::Matrix<double, 3, 4> flipped(Eigen::Matrix<double, 3, 4> affine) {
  affine.topRows<2>() *= -1;
  return affine;
}

TEST(NiftiWriter, WhatIsWrittenIsReadBack) {
  const TemporaryFolder folder;
  for (const char* name : {"v.nii", "v.nii.gz"}) {
    Volume volume;
    volume.dims = {3, 4, 5};
    volume.data = sample_values<std::int16_t>(60);
    volume.affine << 0.5, 0, 0, 1, 0, 2, 0, -3, 0, 0, 4, 7;
    volume.slope = 0.5;
    volume.intercept = -3;
    write_nifti(folder / name, volume, false);
    const VolumeFile file = read_both_ways(folder / name);
    EXPECT_EQ(file.volume.dims, volume.dims);
    EXPECT_EQ(file.volume.data, volume.data);
    EXPECT_TRUE(file.volume.affine.isApprox(volume.affine));
    EXPECT_EQ(file.volume.slope, 0.5);
    EXPECT_EQ(file.volume.intercept, -3);
    EXPECT_EQ(file.orientation, "LPS");
    EXPECT_EQ(file.datatype, "int16");
    EXPECT_EQ(file.format, "NIfTI-1");
    EXPECT_EQ(file.transform, "sform");
    EXPECT_THAT(file.warnings, IsEmpty());
  }
}

TEST(NiftiWriter, QformAgreesWithSformForRotatedAndMirroredVolumes) {
  const TemporaryFolder folder;
  for (const double mirror : {1.0, -1.0}) {
    Volume volume;
    volume.dims = {30, 40, 50};
    volume.data = std::vector<float>(60000);
    Mat3 rotation = Eigen::AngleAxisd(0.7, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
    volume.affine.leftCols<3>() = rotation * Vec3(0.8, 0.9, mirror * 2.5).asDiagonal();
    volume.affine.col(3) = Vec3(-100, 55, 1000);
    write_nifti(folder / "v.nii", volume, true);
    VolumeOptions options;
    options.prefer_qform = true;
    const VolumeFile file = read_both_ways(folder / "v.nii", options);
    EXPECT_EQ(file.transform, "qform");
    EXPECT_THAT(file.warnings, IsEmpty());
    EXPECT_LT((file.volume.affine - volume.affine).cwiseAbs().maxCoeff(), 1e-4);
  }
}

TEST(NiftiWriter, AShearedVolumeHasNoQform) {
  const TemporaryFolder folder;
  Volume volume;
  volume.dims = {1, 1, 1};
  volume.data = std::vector<std::uint8_t>(1);
  volume.affine << 1, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0;
  write_nifti(folder / "v.nii", volume, false);
  VolumeOptions options;
  options.prefer_qform = true;
  const VolumeFile file = read_both_ways(folder / "v.nii", options);
  EXPECT_EQ(file.transform, "sform");
  EXPECT_THAT(texts_of(file.warnings), testing::ElementsAre(HasSubstr("no qform")));
  EXPECT_TRUE(file.volume.affine.isApprox(volume.affine));
}

TEST(NiftiWriter, SameVolumeSameBytes) {
  const TemporaryFolder folder;
  Volume volume;
  volume.dims = {3, 4, 5};
  volume.data = sample_values<double>(60);
  write_nifti(folder / "a.nii.gz", volume, false);
  write_nifti(folder / "b.nii.gz", volume, false);
  const std::string bytes = bytes_of(folder / "a.nii.gz");
  EXPECT_EQ(bytes, bytes_of(folder / "b.nii.gz"));
  EXPECT_EQ(bytes.substr(3, 5), std::string(5, '\0'));  // no name, no time
}

TEST(NiftiWriter, RefusesWhatDoesNotFitAndWhatExists) {
  const TemporaryFolder folder;
  Volume volume;
  volume.dims = {40000, 1, 1};
  volume.data = std::vector<std::uint8_t>(40000);
  EXPECT_THROW(write_nifti(folder / "v.nii", volume, false), InputError);
  EXPECT_FALSE(std::filesystem::exists(folder / "v.nii.part"));
  volume.dims = {1, 1, 1};
  volume.data = std::vector<std::uint8_t>(1);
  write_nifti(folder / "v.nii", volume, false);
  EXPECT_THROW(write_nifti(folder / "v.nii", volume, false), OutputError);
}

template <class T>
class NiftiType : public testing::Test {};
using Types = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::uint32_t, std::int32_t,
                             std::uint64_t, std::int64_t, float, double>;
TYPED_TEST_SUITE(NiftiType, Types);

template <class T>
int datatype_code() {
  constexpr std::array<int, 10> codes{2, 256, 512, 4, 768, 8, 1280, 1024, 16, 64};
  return codes.at(Volume::Data(std::vector<T>()).index());
}

TYPED_TEST(NiftiType, EveryVersionEndianAndCompression) {
  const TemporaryFolder folder;
  const auto values = sample_values<TypeParam>(60);
  for (const int version : {1, 2}) {
    for (const Endian endian : {Endian::little, Endian::big}) {
      for (const bool gzip : {false, true}) {
        NiftiOptions options;
        options.version = version;
        options.endian = endian;
        const std::string bytes =
            nifti_header(options, datatype_code<TypeParam>(), 8 * sizeof(TypeParam)) + encoded(values, endian);
        folder.file("v.nii", gzip ? deflated(bytes) : bytes);  // by content, whatever the name
        const VolumeFile file = read_both_ways(folder / "v.nii");
        EXPECT_EQ(std::get<std::vector<TypeParam>>(file.volume.data), values);
        EXPECT_EQ(file.format, version == 1 ? "NIfTI-1" : "NIfTI-2");
        EXPECT_TRUE(file.volume.affine.isApprox(flipped(sample_affine())));
        EXPECT_EQ(file.orientation, "RAS");
        EXPECT_EQ(file.spacing, Vec3(2, 3, 4));
        EXPECT_THAT(file.warnings, IsEmpty());
      }
    }
  }
}

TEST(Nifti, ThePairOfHeaderAndImage) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.pair = true;
  const auto values = sample_values<std::uint8_t>(60);
  folder.file("v.hdr", nifti_header(options, 2, 8).substr(0, 348));
  EXPECT_THAT(error_of(folder / "v.hdr"), HasSubstr("v.img is missing"));
  folder.file("v.img.gz", deflated(encoded(values, Endian::little)));
  EXPECT_EQ(std::get<0>(read_both_ways(folder / "v.hdr").volume.data), values);
  folder.file("v.img", encoded(values, Endian::little).substr(0, 50));
  EXPECT_THAT(error_of(folder / "v.hdr"), AllOf(HasSubstr("v.img"), HasSubstr("10 of the 60 bytes")));
}

TEST(Nifti, OtherDatatypesAreRefused) {
  const TemporaryFolder folder;
  for (const int code : {0, 1, 32, 128, 255, 1536, 1792, 2048, 2304, 77, -1}) {
    folder.file("v.nii", nifti_header({}, code, 8) + std::string(4000, '\0'));
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("datatype " + std::to_string(code)));
  }
}

TEST(NiftiTransform, QformWhenThereIsNoSform) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.sform_code = 0;
  options.qform_code = 1;
  options.pixdim = {-1, 2, 3, 4};
  const double half = std::sqrt(0.5);
  options.quatern = {0, 0, half, 5, 6, 7};  // a quarter turn about z
  folder.file("v.nii", nifti_file(options));
  const VolumeFile file = read_both_ways(folder / "v.nii");
  Eigen::Matrix<double, 3, 4> ras;
  ras << 0, -3, 0, 5, 2, 0, 0, 6, 0, 0, -4, 7;
  EXPECT_LT((file.volume.affine - flipped(ras)).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(file.transform, "qform");
  EXPECT_EQ(file.orientation, "ALI");
}

TEST(NiftiTransform, BothAndDifferent) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.qform_code = 1;
  options.quatern = {0, 0, 0, 11, 20, 30};
  folder.file("v.nii", nifti_file(options));
  VolumeFile file = read_both_ways(folder / "v.nii");
  EXPECT_EQ(file.volume.affine(0, 3), -10);
  EXPECT_THAT(texts_of(file.warnings),
              testing::ElementsAre(AllOf(HasSubstr("sform [2 0 0 10]"), HasSubstr("qform [2 0 0 11]"),
                                         HasSubstr("the sform is used"), HasSubstr("--prefer-qform"))));
  VolumeOptions prefer;
  prefer.prefer_qform = true;
  file = read_both_ways(folder / "v.nii", prefer);
  EXPECT_EQ(file.volume.affine(0, 3), -11);
  EXPECT_THAT(texts_of(file.warnings), testing::ElementsAre(HasSubstr("the qform is used")));
}

TEST(NiftiTransform, AnSformOfOtherVoxelsThanStatedIsSaid) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.pixdim = {1, 4, 3, 4};
  folder.file("v.nii", nifti_file(options));
  const VolumeFile file = read_both_ways(folder / "v.nii");
  EXPECT_EQ(file.volume.affine(0, 0), -2);
  EXPECT_THAT(texts_of(file.warnings),
              testing::ElementsAre(HasSubstr("its sform has voxels of 2 x 3 x 4, its pixdim of 4 x 3 x 4")));
}

TEST(NiftiTransform, NeitherIsASpacingWithAWarning) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.sform_code = 0;
  options.pixdim = {0, -2, 3, 4};
  folder.file("v.nii", nifti_file(options));
  const VolumeFile file = read_both_ways(folder / "v.nii");
  EXPECT_EQ(file.volume.affine(0, 0), -2);
  EXPECT_EQ(file.volume.affine(1, 1), -3);
  EXPECT_EQ(file.volume.affine(2, 2), 4);
  EXPECT_THAT(texts_of(file.warnings), testing::ElementsAre(HasSubstr("neither sform nor qform")));
  options.pixdim = {0, 2, 0, 4};
  folder.file("v.nii", nifti_file(options));
  EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("spacing"));
}

TEST(NiftiTransform, UnitsScaleToMillimetres) {
  const TemporaryFolder folder;
  for (const auto& [units, scale] : {std::pair(1, 1000.0), {2, 1.0}, {3, 0.001}, {2 + 8, 1.0}, {0, 1.0}, {5, 1.0}}) {
    NiftiOptions options;
    options.units = units;
    folder.file("v.nii", nifti_file(options));
    const VolumeFile file = read_both_ways(folder / "v.nii");
    EXPECT_TRUE(file.volume.affine.isApprox(scale * flipped(sample_affine()))) << units;
    const bool metres = units == 1;  // of a voxel's edge: no scanner has that
    ASSERT_EQ(file.warnings.size(), units == 0 || units == 5 || metres ? 1U : 0U);
    EXPECT_TRUE(!metres || file.warnings[0].text.ends_with("mm: is their unit right?")) << file.warnings[0].text;
  }
}

TEST(NiftiTransform, NotFiniteOrSingularIsRefused) {
  const TemporaryFolder folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {nan, std::numeric_limits<double>::infinity(), 1e30}) {
    NiftiOptions options;
    options.sform[5] = bad;
    folder.file("v.nii", nifti_file(options));
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr(bad == 1e30 ? "sform reaches 1e+30 mm" : "sform is not finite"));
    options.sform_code = 0;
    options.qform_code = 1;
    options.quatern[1] = bad;
    folder.file("v.nii", nifti_file(options));
    error_of(folder / "v.nii");
  }
  NiftiOptions options;
  options.sform = {2, 4, 0, 0, 1, 2, 0, 0, 0, 0, 1, 0};
  folder.file("v.nii", nifti_file(options));
  EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("singular"));
  // Two axes, of 1 mm each, that are nearly one: what parts them is far above rounding.
  for (const double apart : {1e-5, 1e-3, 9e-3}) {
    options.sform = {1, 0, 0, 0, 0, 1, 1, 0, 0, 0, apart, 0};
    folder.file("v.nii", nifti_file(options));
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("sform is singular or nearly so")) << apart;
  }
  options.sform = {1, 0, 0, 0, 0, 1, 0.6, 0, 0, 0, 1, 0};  // a tilted gantry
  EXPECT_NO_THROW(read_volume(folder.file("tilted.nii", nifti_file(options))));
}

TEST(NiftiTransform, AnSformThatCannotBeGivesWayToTheQform) {
  const TemporaryFolder folder;
  NiftiOptions good;
  good.sform_code = 0;
  good.qform_code = 1;
  good.quatern = {0, 0, 0, 10, 20, 30};
  const auto expected = read_volume(folder.file("good.nii", nifti_file(good))).volume.affine;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& sform :
       {std::array<double, 12>{}, {2, 4, 0, 0, 1, 2, 0, 0, 0, 0, 1, 0}, {nan, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0}}) {
    for (const bool prefer_qform : {false, true}) {
      NiftiOptions options = good;
      options.sform_code = 1;
      options.sform = sform;
      VolumeOptions reading;
      reading.prefer_qform = prefer_qform;
      const VolumeFile file = read_both_ways(folder.file("v.nii", nifti_file(options)), reading);
      EXPECT_EQ(file.transform, "qform");
      EXPECT_EQ(file.volume.affine, expected);
      EXPECT_THAT(texts_of(file.warnings),
                  testing::ElementsAre(AllOf(HasSubstr("its sform "), HasSubstr("the qform is used instead"))));
      options.qform_code = 0;
      EXPECT_THAT(error_of(folder.file("v.nii", nifti_file(options)), reading),
                  AllOf(HasSubstr("its sform "), HasSubstr("its qform is not set (its code is 0)")));
    }
  }
}

TEST(NiftiTransform, AQformThatCannotBeGivesWayToTheSform) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.qform_code = 1;
  options.quatern = {1, 1, 1, 0, 0, 0};
  VolumeOptions prefer;
  prefer.prefer_qform = true;
  const VolumeFile file = read_both_ways(folder.file("v.nii", nifti_file(options)), prefer);
  EXPECT_EQ(file.transform, "sform");
  EXPECT_THAT(texts_of(file.warnings),
              testing::ElementsAre(HasSubstr(
                  "its qform has the quaternion (1, 1, 1), which is no rotation: the sform is used instead")));
  EXPECT_THAT(read_both_ways(folder / "v.nii").warnings, IsEmpty());
  options.sform_code = 0;
  EXPECT_THAT(error_of(folder.file("v.nii", nifti_file(options))), HasSubstr("no rotation"));
}

TEST(Nifti, AChannelBeforeThreeAxesOfSpace) {
  const TemporaryFolder folder;
  for (const std::vector<std::int64_t>& dims :
       {std::vector<std::int64_t>{1, 3, 4, 5}, {1, 1, 3, 4, 5}, {1, 3, 4, 5, 1}}) {
    NiftiOptions options;
    options.dims = dims;
    const VolumeFile file = read_both_ways(folder.file("v.nii", nifti_file(options)));
    EXPECT_EQ(file.volume.dims, (std::array<std::size_t, 3>{3, 4, 5}));
    EXPECT_EQ(values_of(file.volume), values_of(read_volume(folder.file("p.nii", nifti_file())).volume));
    EXPECT_EQ(file.spacing, Vec3(2, 3, 4));
    ASSERT_EQ(file.warnings.size(), 1U);
    EXPECT_EQ(file.warnings[0].weight, Weight::note);
    EXPECT_THAT(file.warnings[0].text, HasSubstr("the leading 1 is taken as a channel"));
  }
  NiftiOptions options;
  options.dims = {1, 3, 4, 5};
  VolumeOptions frame;
  frame.frame = 2;
  const VolumeFile series = read_both_ways(folder.file("v.nii", nifti_file(options)), frame);
  EXPECT_EQ(series.volume.dims, (std::array<std::size_t, 3>{1, 3, 4}));
  EXPECT_THAT(texts_of(series.warnings), testing::ElementsAre(HasSubstr("a single slice")));
}

TEST(Nifti, ClassesAsChannelsAreNoSeries) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.dims = {2, 5, 4, 6};
  folder.file("v.nii", nifti_file(options));
  EXPECT_THAT(error_of(folder / "v.nii"), AllOf(HasSubstr("2 x 5 x 4 x 6: its first axis looks like 2 channels"),
                                                HasSubstr("argmax over the first axis"), HasSubstr("--frame 0..5")));
  VolumeOptions frame;
  frame.frame = 2;
  const VolumeFile file = read_both_ways(folder / "v.nii", frame);
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_EQ(file.warnings[0].weight, Weight::major);
  options.dims = {5, 5, 4, 6};
  EXPECT_THAT(error_of(folder.file("v.nii", nifti_file(options))), HasSubstr("has 6 frames"));
}

TEST(NiftiPair, TheVoxelsMayBeNamed) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.pair = true;
  folder.file("v.img", voxels);
  EXPECT_THAT(error_of(folder / "v.img"), HasSubstr("is not a volume"));
  folder.file("v.hdr", nifti_header(options, 2, 8).substr(0, 348));
  const VolumeFile file = read_both_ways(folder / "v.img");
  EXPECT_EQ(values_of(file.volume), values_of(read_volume(folder / "v.hdr").volume));
  EXPECT_THAT(file.data_files, testing::ElementsAre(folder / "v.hdr"));
  folder.file("w.hdr", nifti_header(options, 2, 8).substr(0, 348));
  folder.file("w.img.gz", deflated(voxels));
  EXPECT_EQ(values_of(read_both_ways(folder / "w.img.gz").volume), values_of(file.volume));
}

TEST(Nifti, ScaleIsKeptAndSlopeZeroMeansNone) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.slope = 2;
  options.intercept = -1024;
  folder.file("v.nii", nifti_file(options));
  EXPECT_EQ(read_both_ways(folder / "v.nii").volume.slope, 2);
  EXPECT_EQ(read_both_ways(folder / "v.nii").volume.intercept, -1024);
  for (const double none : {0.0, std::numeric_limits<double>::quiet_NaN()}) {
    options.slope = none;
    folder.file("v.nii", nifti_file(options));
    EXPECT_EQ(read_both_ways(folder / "v.nii").volume.slope, 1);
    EXPECT_EQ(read_both_ways(folder / "v.nii").volume.intercept, 0);
  }
}

TEST(Nifti, AFrameHasToBeChosen) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.dims = {3, 4, 5, 3};
  for (const bool gzip : {false, true}) {
    const std::string bytes = nifti_file(options);
    folder.file("v.nii", gzip ? deflated(bytes) : bytes);
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("has 3 frames: choose one with --frame 0..2"));
    const auto all = sample_values<std::uint8_t>(180);
    for (std::size_t frame = 0; frame < 3; ++frame) {
      VolumeOptions choice;
      choice.frame = frame;
      const VolumeFile file = read_both_ways(folder / "v.nii", choice);
      EXPECT_EQ(file.frames, 3U);
      EXPECT_EQ(std::get<0>(file.volume.data),
                std::vector<std::uint8_t>(all.begin() + static_cast<long>(frame * 60),
                                          all.begin() + static_cast<long>(frame * 60 + 60)));
    }
    VolumeOptions choice;
    choice.frame = 3;
    EXPECT_THAT(error_of(folder / "v.nii", choice), HasSubstr("--frame 3 does not exist: choose one of 0..2"));
    choice = {};
    choice.layer = 1;
    error_of(folder / "v.nii", choice);
  }
  options.dims = {3, 4, 5, 1, 1};
  folder.file("v.nii", nifti_file(options));
  EXPECT_NO_THROW(read_both_ways(folder / "v.nii"));
  options.dims = {3, 4, 5, 1, 3};
  folder.file("v.nii", nifti_file(options));
  EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("3 values per voxel"));
}

TEST(NiftiDamage, TruncatedAnywhereSaysWhatIsMissing) {
  const TemporaryFolder folder;
  for (const int version : {1, 2}) {
    NiftiOptions options;
    options.version = version;
    const std::string bytes = nifti_file(options);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      folder.file("v.nii", bytes.substr(0, size));
      const std::string message = error_of(folder / "v.nii");
      if (size >= bytes.size() - 60) {
        EXPECT_THAT(message, HasSubstr("truncated: "));
        EXPECT_THAT(message, HasSubstr(std::to_string(bytes.size() - size) + " of the 60 bytes"));
      } else if (size >= 8) {
        EXPECT_THAT(message, HasSubstr("truncated")) << size;
        EXPECT_THAT(message, HasSubstr(" bytes")) << size;
      }
    }
    const std::string packed = deflated(bytes);
    for (std::size_t size = 0; size < packed.size(); ++size) {
      folder.file("v.nii.gz", packed.substr(0, size));
      error_of(folder / "v.nii.gz");
    }
  }
}

TEST(NiftiDamage, GzipCutInTheVoxelsSaysHowManyAreMissing) {
  const TemporaryFolder folder;
  NiftiOptions options;
  options.dims = {30, 40, 50};
  std::vector<std::uint8_t> noise(60000);
  for (std::size_t i = 0; i < noise.size(); ++i) {
    noise[i] = static_cast<std::uint8_t>((i * 2654435761U) >> 13);
  }
  const std::string packed = deflated(nifti_header(options, 2, 8) + encoded(noise, Endian::little));
  folder.file("v.nii.gz", packed.substr(0, packed.size() / 2));
  EXPECT_THAT(error_of(folder / "v.nii.gz"), testing::ContainsRegex("truncated: [0-9]+ of the 60000 bytes"));
  folder.file("v.nii.gz", packed.substr(0, packed.size() - 3));
  EXPECT_THAT(error_of(folder / "v.nii.gz"), HasSubstr("truncated"));
}

TEST(NiftiDamage, AFlippedBitInTheGzipStreamIsNoticed) {
  const TemporaryFolder folder;
  const std::string packed = deflated(nifti_file());
  for (const std::size_t place : {packed.size() - 1, packed.size() - 6, packed.size() - 20}) {
    std::string damaged = packed;
    damaged[place] = static_cast<char>(damaged[place] ^ 4);
    folder.file("v.nii.gz", damaged);
    error_of(folder / "v.nii.gz");
  }
}

TEST(NiftiDamage, TrailingBytesWarn) {
  const TemporaryFolder folder;
  const std::string bytes = nifti_file();
  folder.file("v.nii", bytes + "more");
  EXPECT_THAT(texts_of(read_both_ways(folder / "v.nii").warnings),
              testing::ElementsAre(HasSubstr("4 bytes follow the voxels")));
  folder.file("v.nii", deflated(bytes + "more"));
  EXPECT_THAT(texts_of(read_both_ways(folder / "v.nii").warnings),
              testing::ElementsAre(HasSubstr("4 bytes follow the voxels")));
  folder.file("v.nii", deflated(bytes) + "more");
  EXPECT_THAT(texts_of(read_both_ways(folder / "v.nii").warnings),
              testing::ElementsAre(HasSubstr("follow its compressed stream")));
  folder.file("v.nii", deflated(bytes.substr(0, 380)) + deflated(bytes.substr(380)));
  EXPECT_THAT(read_both_ways(folder / "v.nii").warnings, IsEmpty());
}

TEST(NiftiDamage, HostileSizesAreRefusedBeforeMemoryIsTaken) {
  const TemporaryFolder folder;
  using Dims = std::vector<std::int64_t>;
  const std::int64_t huge = std::int64_t{1} << 40;
  for (const Dims& dims : {Dims{32767, 32767, 32767}, Dims{-3, 4, 5}, Dims{3, 0, 5}, Dims{3, 4, 5, 30000}}) {
    NiftiOptions options;
    options.dims = dims;
    const std::string bytes = nifti_header(options, 64, 64) + std::string(1000, 'x');
    for (const bool gzip : {false, true}) {
      folder.file("v.nii", gzip ? deflated(bytes) : bytes);
      VolumeOptions choice;
      choice.frame = 0;
      error_of(folder / "v.nii", choice);
    }
  }
  for (const Dims& dims : {Dims{huge, 1, 1}, Dims{huge, huge, huge}, Dims{10000, 10000, 10000},
                           Dims{std::numeric_limits<std::int64_t>::max(), 1, 1}, Dims{1, 1, 1, huge}}) {
    NiftiOptions options;
    options.version = 2;
    options.dims = dims;
    const std::string bytes = nifti_header(options, 64, 64) + std::string(1000, 'x');
    for (const bool gzip : {false, true}) {
      folder.file("v.nii", gzip ? deflated(bytes) : bytes);
      VolumeOptions choice;
      choice.frame = 0;
      error_of(folder / "v.nii", choice);
    }
  }
  for (const int count : {0, -1, 8, 30000}) {
    std::string bytes = nifti_file();
    put(bytes, 40, static_cast<std::int16_t>(count));
    folder.file("v.nii", bytes);
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("dimensions"));
  }
  for (const double offset : {1.0, 351.0, 352.5, 1e30, std::numeric_limits<double>::quiet_NaN()}) {
    std::string bytes = nifti_file();
    put(bytes, 108, static_cast<float>(offset));
    folder.file("v.nii", bytes);
    EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("voxels begin at byte"));
  }
  NiftiOptions options;
  options.vox_offset = 1000;
  folder.file("v.nii", nifti_file(options));
  EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("begin at byte 1000, and it ends 588 bytes before"));
}

TEST(NiftiDamage, AnalyzeAndDamagedMagic) {
  const TemporaryFolder folder;
  std::string bytes = nifti_file();
  bytes.replace(344, 4, std::string(4, '\0'));
  folder.file("v.hdr", bytes);
  EXPECT_THAT(error_of(folder / "v.hdr"), HasSubstr("Analyze"));
  bytes.replace(344, 4, "n+9\0");
  folder.file("v.nii", bytes);
  EXPECT_THAT(error_of(folder / "v.nii"), HasSubstr("magic"));
}

}  // namespace
}  // namespace tunica::test
