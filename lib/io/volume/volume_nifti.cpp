// NIfTI-1 and NIfTI-2: https://nifti.nimh.nih.gov/pub/dist/src/niftilib/nifti1.h and .../nifti2.h

#include "tunica/core/error.hpp"
#include "tunica/io/volume/detail/label_table.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

using Affine = Eigen::Matrix<double, 3, 4>;

constexpr std::size_t size_1 = 348;
constexpr std::size_t size_2 = 540;

// The fields that matter, from either version.
struct Header {
  int version = 1;
  bool big_endian = false;
  bool pair = false;  // .hdr and .img
  std::array<std::int64_t, 8> dim{};
  std::array<double, 8> pixdim{};
  std::int64_t datatype = 0;
  double vox_offset = 0;
  double slope = 0;
  double intercept = 0;
  std::int64_t units = 0;
  std::int64_t intent = 0;
  std::int64_t qform_code = 0;
  std::int64_t sform_code = 0;
  std::array<double, 6> quatern{};  // b, c, d, x, y, z
  std::array<double, 12> srow{};
};

// Reads numbers at byte offsets of a header, in the file's byte order.
class Fields {
public:
  Fields(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  template <class T>
  [[nodiscard]] T at(std::size_t offset) const {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset, sizeof(T));
    if (big_endian_ != (std::endian::native == std::endian::big)) {
      std::reverse(raw.begin(), raw.end());
    }
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }

  template <class T, std::size_t size, class To>
  void array(std::size_t offset, std::array<To, size>& to) const {
    for (std::size_t i = 0; i < size; ++i) {
      to[i] = static_cast<To>(at<T>(offset + i * sizeof(T)));
    }
  }

private:
  std::string_view bytes_;
  bool big_endian_;
};

// 1 or 2, or 0 when it is no NIfTI header.
int version_of(std::string_view head, bool big_endian) {
  if (head.size() < 4) {
    return 0;
  }
  const auto size = Fields(head, big_endian).at<std::int32_t>(0);
  if (size == static_cast<std::int32_t>(size_2) && head.size() >= 8 && head.substr(4, 1) == "n") {
    return 2;
  }
  return size == static_cast<std::int32_t>(size_1) ? 1 : 0;
}

Header parse_1(const Fields& fields) {
  Header header;
  fields.array<std::int16_t>(40, header.dim);
  header.intent = fields.at<std::int16_t>(68);
  header.datatype = fields.at<std::int16_t>(70);
  fields.array<float>(76, header.pixdim);
  header.vox_offset = fields.at<float>(108);
  header.slope = fields.at<float>(112);
  header.intercept = fields.at<float>(116);
  header.units = fields.at<std::uint8_t>(123);
  header.qform_code = fields.at<std::int16_t>(252);
  header.sform_code = fields.at<std::int16_t>(254);
  fields.array<float>(256, header.quatern);
  fields.array<float>(280, header.srow);
  return header;
}

Header parse_2(const Fields& fields) {
  Header header;
  header.version = 2;
  header.datatype = fields.at<std::int16_t>(12);
  fields.array<std::int64_t>(16, header.dim);
  fields.array<double>(104, header.pixdim);
  header.vox_offset = static_cast<double>(fields.at<std::int64_t>(168));
  header.slope = fields.at<double>(176);
  header.intercept = fields.at<double>(184);
  header.qform_code = fields.at<std::int32_t>(344);
  header.sform_code = fields.at<std::int32_t>(348);
  fields.array<double>(352, header.quatern);
  fields.array<double>(400, header.srow);
  header.units = fields.at<std::int32_t>(500);
  header.intent = fields.at<std::int32_t>(504);
  return header;
}

Header parse(const fs::path& path, std::string_view head) {
  bool big_endian = false;
  int version = version_of(head, big_endian);
  if (version == 0) {
    big_endian = true;
    version = version_of(head, big_endian);
  }
  TUNICA_ASSERT(version != 0);
  const std::size_t size = version == 1 ? size_1 : size_2;
  if (head.size() < size) {
    throw InputError(
        fmt::format("{}: truncated: {} of the {} bytes of its NIfTI-{} header are missing; get the whole "
                    "file again",
                    path.string(), size - head.size(), size, version));
  }
  const std::string_view magic = version == 1 ? head.substr(344, 4) : head.substr(4, 8);
  const std::string_view single = version == 1 ? std::string_view("n+1\0", 4) : std::string_view("n+2\0\r\n\x1a\n", 8);
  const std::string_view pair = version == 1 ? std::string_view("ni1\0", 4) : std::string_view("ni2\0\r\n\x1a\n", 8);
  if (magic != single && magic != pair) {
    throw InputError(fmt::format("{}: {}", path.string(),
                                 version == 1 && magic == std::string_view("\0\0\0\0", 4)
                                     ? "is an Analyze 7.5 header, which has no orientation: convert it to NIfTI"
                                     : "its NIfTI header has a damaged magic string: get the file again"));
  }
  const Fields fields(head, big_endian);
  Header header = version == 1 ? parse_1(fields) : parse_2(fields);
  header.big_endian = big_endian;
  header.pair = magic == pair;
  return header;
}

VoxelType voxel_type(const fs::path& path, std::int64_t code) {
  switch (code) {
    case 2:
      return VoxelType::uint8;
    case 4:
      return VoxelType::int16;
    case 8:
      return VoxelType::int32;
    case 16:
      return VoxelType::float32;
    case 64:
      return VoxelType::float64;
    case 256:
      return VoxelType::int8;
    case 512:
      return VoxelType::uint16;
    case 768:
      return VoxelType::uint32;
    case 1024:
      return VoxelType::int64;
    case 1280:
      return VoxelType::uint64;
    default:
      break;
  }
  const char* name = code == 1                                    ? "single bits"
                     : code == 32 || code == 1792 || code == 2048 ? "complex numbers"
                     : code == 128 || code == 2304                ? "colours"
                     : code == 1536                               ? "128-bit floats"
                                                                  : "of an unknown type";
  throw InputError(
      fmt::format("{}: its voxels are {} (NIfTI datatype {}): convert them to integers or to 32- or 64-bit "
                  "floats",
                  path.string(), name, code));
}

// Millimetres per unit of the header's lengths.
double unit_size(const fs::path& path, std::int64_t xyzt_units, std::vector<Warning>& warnings) {
  switch (xyzt_units & 7) {
    case 1:
      return 1000;
    case 2:
      return 1;
    case 3:
      return 0.001;
    default:
      break;
  }
  warnings.push_back({Weight::note, "unit of length",
                      fmt::format("{}: the header names no known unit of length (xyzt_units {}): taken as mm",
                                  path.string(), xyzt_units)});
  return 1;
}

// The three spacings; a negative one loses its sign, as in every other reader.
Vec3 spacing_of(const Header& header) {
  return {std::abs(header.pixdim[1]), std::abs(header.pixdim[2]), std::abs(header.pixdim[3])};
}

Affine sform(const Header& header) {
  Affine affine;
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 4; ++column) {
      affine(row, column) = header.srow[row * 4 + column];
    }
  }
  return affine;
}

// nifti1.h, "METHOD 2". In long double and in this order nibabel's affine is met to the last bit. Where the quaternion
// leaves less than 1e-7 for the square of its first part, that is 0, as in nifti1_io.c and ITK; nibabel takes its root.
Affine qform(const Header& header) {
  using Real = long double;
  const Real x = header.quatern[0];
  const Real y = header.quatern[1];
  const Real z = header.quatern[2];
  const Real rest = 1 - (x * x + y * y + z * z);
  const Real w = rest > 1e-7L ? std::sqrt(rest) : 0;
  const Real s = 2 / (w * w + x * x + y * y + z * z);
  const Real sx = x * s;
  const Real sy = y * s;
  const Real sz = z * s;
  const std::array<std::array<Real, 3>, 3> rotation{{{1 - (y * sy + z * sz), x * sy - w * sz, x * sz + w * sy},
                                                     {x * sy + w * sz, 1 - (x * sx + z * sz), y * sz - w * sx},
                                                     {x * sz - w * sy, y * sz + w * sx, 1 - (x * sx + y * sy)}}};
  Vec3 scale = spacing_of(header);
  if (header.pixdim[0] < 0) {
    scale.z() = -scale.z();
  }
  Affine affine;
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 3; ++column) {
      affine(row, column) = static_cast<double>(rotation[row][column] * scale[column]);
    }
    affine(row, 3) = header.quatern[3 + row];
  }
  return affine;
}

Affine without_orientation(const Header& header) {
  Affine affine = Affine::Zero();
  affine.leftCols<3>() = spacing_of(header).asDiagonal();
  return affine;
}

std::string printed(const Affine& affine) {
  std::string text;
  for (Eigen::Index row = 0; row < 3; ++row) {
    text += fmt::format("{}[{:.6g} {:.6g} {:.6g} {:.6g}]", row > 0 ? " " : "", affine(row, 0), affine(row, 1),
                        affine(row, 2), affine(row, 3));
  }
  return text;
}

// Largest distance between the places the two give a corner of the volume.
double difference(const Affine& a, const Affine& b, const std::array<std::size_t, 3>& dims) {
  double largest = 0;
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector4d index(0, 0, 0, 1);
    for (int axis = 0; axis < 3; ++axis) {
      index[axis] = ((corner >> axis) & 1) != 0 ? static_cast<double>(dims[axis] - 1) : 0;
    }
    largest = std::max(largest, ((a - b) * index).norm());
  }
  return largest;
}

// Why the sform (qform) places no voxels; none where it does.
std::optional<std::string> sform_error(const Header& header) {
  return header.sform_code > 0 ? affine_error(sform(header)) : "is not set (its code is 0)";
}

std::optional<std::string> qform_error(const Header& header) {
  if (!(header.qform_code > 0)) {
    return "is not set (its code is 0)";
  }
  if (!(spacing_of(header).minCoeff() > 0)) {
    return fmt::format("has voxels of {} x {} x {} mm", header.pixdim[1], header.pixdim[2], header.pixdim[3]);
  }
  if (!(Vec3(header.quatern.data()).squaredNorm() < 1.01)) {
    return fmt::format("has the quaternion ({}, {}, {}), which is no rotation", header.quatern[0], header.quatern[1],
                       header.quatern[2]);
  }
  return affine_error(qform(header));
}

// sform if its code > 0, else qform, else the spacing alone; --prefer-qform turns the first two round. One that cannot
// be gives way to the other.
void set_transform(VolumeFile& file, const fs::path& path, const Header& header, bool prefer_qform) {
  const auto no_sform = sform_error(header);
  const auto no_qform = qform_error(header);
  const bool has_sform = !no_sform;
  const bool has_qform = !no_qform;
  const bool use_qform = has_qform && (prefer_qform || !has_sform);
  const bool damaged = (header.sform_code > 0 && !has_sform) || (header.qform_code > 0 && !has_qform);
  if (damaged && !has_sform && !has_qform) {
    throw InputError(fmt::format(
        "{}: its sform {}, its qform {}: nothing says where its voxels are; copy the header of the image that was "
        "segmented",
        path.string(), *no_sform, *no_qform));
  }
  file.transform = use_qform ? "qform" : has_sform ? "sform" : "spacing";
  if (prefer_qform && header.qform_code <= 0) {
    file.warnings.push_back(
        {Weight::minor, "world transform",
         fmt::format("{}: has no qform (its code is 0): its {} is used", path.string(), file.transform)});
  }
  if (damaged && (use_qform || prefer_qform)) {
    file.warnings.push_back(
        {Weight::minor, "world transform",
         fmt::format("{}: its {} {}: the {} is used instead; compare the surface's place with the image's",
                     path.string(), has_sform ? "qform" : "sform", has_sform ? *no_qform : *no_sform, file.transform)});
  }
  if (has_sform && has_qform) {
    const double apart = difference(sform(header), qform(header), file.volume.dims);
    const double smallest = spacing_of(header).minCoeff();
    if (!(apart <= 0.01 * smallest)) {
      file.warnings.push_back(
          {Weight::minor, "world transform",
           fmt::format("{}: its sform {} and qform {} place a corner of the volume {:.4g} apart; the {} "
                       "is used{}",
                       path.string(), printed(sform(header)), printed(qform(header)), apart, file.transform,
                       use_qform ? "" : " (--prefer-qform takes the other)")});
    }
  }
  if (has_sform && !has_qform) {
    const Vec3 edges = sform(header).leftCols<3>().colwise().norm().transpose();
    const Vec3 stated = spacing_of(header);
    constexpr double notable = 0.01;
    if (stated.minCoeff() > 0 && ((edges - stated).cwiseAbs().array() > notable * stated.array()).any()) {
      file.warnings.push_back(
          {Weight::major, "world transform",
           fmt::format("{}: its sform has voxels of {:.4g} x {:.4g} x {:.4g}, its pixdim of {:.4g} x {:.4g} x {:.4g}: "
                       "the sform is used; compare with the image that was segmented, and correct the header",
                       path.string(), edges[0], edges[1], edges[2], stated[0], stated[1], stated[2])});
    }
  }
  if (!has_sform && !has_qform) {
    file.warnings.push_back(
        {Weight::major, "world transform",
         fmt::format("{}: has neither sform nor qform: voxels are placed by their spacing alone, with "
                     "axes to the right, front and top, so left and right may be exchanged; copy the header of the "
                     "image that was segmented",
                     path.string())});
  }
  if (file.transform == "spacing" && !(spacing_of(header).minCoeff() > 0)) {
    throw InputError(fmt::format("{}: its voxel spacing {} x {} x {} is not positive: correct the header",
                                 path.string(), header.pixdim[1], header.pixdim[2], header.pixdim[3]));
  }
  const double scale = unit_size(path, header.units, file.warnings);
  const Affine ras = use_qform ? qform(header) : has_sform ? sform(header) : without_orientation(header);
  set_affine(file, path, flip_xy(scale * ras));
}

// The seven sizes, with 1 for those that dim[0] does not count, and without leading axes that are channels.
std::array<std::uint64_t, 7> sizes_of(VolumeFile& file, const fs::path& path, const Header& header, bool frame_chosen) {
  if (header.dim[0] < 1 || header.dim[0] > 7) {
    throw InputError(fmt::format("{}: its header counts {} dimensions, between 1 and 7 are possible: it is corrupt",
                                 path.string(), header.dim[0]));
  }
  std::array<std::uint64_t, 7> sizes;
  sizes.fill(1);
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(header.dim[0]); ++axis) {
    const std::int64_t size = header.dim[axis + 1];
    if (size < 1 && axis < 3) {
      throw InputError(
          fmt::format("{}: its size along axis {} is {}: the header is corrupt", path.string(), axis + 1, size));
    }
    sizes[axis] = static_cast<std::uint64_t>(std::max<std::int64_t>(size, 1));
  }
  const std::span<const std::uint64_t> stored(sizes.data(), static_cast<std::size_t>(header.dim[0]));
  if (const std::size_t channels = frame_chosen ? 0 : leading_channels(stored); channels > 0) {
    file.warnings.push_back(channel_note(path, stored));
    std::rotate(sizes.begin(), sizes.begin() + channels, sizes.end());
  }
  for (std::size_t axis = 4; axis < 7; ++axis) {
    if (sizes[axis] > 1) {
      throw InputError(
          fmt::format("{}: its sizes are {}: it has {} values per voxel along its axis {}, and one value per voxel is "
                      "needed; save one volume of labels",
                      path.string(), fmt::join(stored, " x "), sizes[axis], axis + 1));
    }
  }
  return sizes;
}

// X.hdr has X.img or X.img.gz beside it.
fs::path image_of(const fs::path& header) {
  fs::path base = header;
  if (lower_case(base.extension().string()) == ".gz") {
    base.replace_extension();
  }
  for (const char* extension : {".img", ".img.gz", ".IMG"}) {
    const fs::path image = fs::path(base).replace_extension(extension);
    if (fs::exists(image)) {
      return image;
    }
  }
  throw InputError(fmt::format("{}: is the header of a pair, and {} is missing: put it beside the header",
                               header.string(), base.replace_extension(".img").string()));
}

std::uint64_t voxel_offset(const fs::path& path, const Header& header) {
  const double first = header.pair ? 0 : header.version == 1 ? 352 : 544;
  const double offset = header.vox_offset == 0 ? first : header.vox_offset;
  if (!(offset >= first) || offset > 0x1p53 || offset != std::floor(offset)) {
    throw InputError(fmt::format("{}: its voxels begin at byte {}, which is impossible: the header is corrupt",
                                 path.string(), header.vox_offset));
  }
  return static_cast<std::uint64_t>(offset);
}

// Reads the label names of the extensions between the header, which has just been read, and the voxels. What is wrong
// with them is a warning: the voxels are whole.
void read_extensions(VolumeFile& file, const fs::path& path, const Header& header, ByteStream& stream) {
  constexpr std::uint64_t most_bytes = std::uint64_t{4} << 20;
  const std::uint64_t end = header.pair ? std::numeric_limits<std::uint64_t>::max() : voxel_offset(path, header);
  const auto damaged = [&](const std::string& why) {
    file.warnings.push_back(
        {Weight::minor, "label table",
         fmt::format("{}: the label names in its header's extension are damaged: {}", path.string(), why)});
  };
  std::array<char, 8> head{};
  if (stream.read(head.data(), 4) < 4 || head[0] == 0) {
    return;
  }
  while (stream.position() + head.size() <= end && stream.read(head.data(), head.size()) == head.size()) {
    const Fields fields(std::string_view(head.data(), head.size()), header.big_endian);
    const std::int64_t size = fields.at<std::int32_t>(0) - std::int64_t{8};
    const auto code = fields.at<std::int32_t>(4);
    if (size < 0 || static_cast<std::uint64_t>(size) > end - stream.position()) {
      return;  // no extension begins here
    }
    const auto bytes = static_cast<std::uint64_t>(size);
    // Code 0 is TotalSegmentator's, 30 Caret's own.
    if ((code != 0 && code != 30) || bytes > most_bytes) {
      stream.skip(bytes);
      continue;
    }
    std::string text(bytes, '\0');
    text.resize(stream.read(text.data(), text.size()));
    std::optional<std::string> why;
    file.volume.label_names = parse_label_table_xml(text, why);
    if (why) {
      damaged(*why);
    }
    if (!file.volume.label_names.empty()) {
      return;
    }
  }
}

}  // namespace

bool looks_like_nifti(std::string_view head) { return version_of(head, false) != 0 || version_of(head, true) != 0; }

VolumeFile read_nifti(const fs::path& path, const VolumeOptions& options, const SlabSink* sink,
                      const std::optional<fs::path>& image) {
  auto stream = std::make_unique<ByteStream>(path, 0, coding_of(path));
  std::string head(size_2, '\0');
  head.resize(stream->read(head.data(), head.size()));
  const Header header = parse(path, head);

  VolumeFile file;
  file.format = fmt::format("NIfTI-{}{}", header.version, header.pair ? " pair" : "");
  const auto sizes = sizes_of(file, path, header, options.frame.has_value());
  set_dims(file, path, std::span<const std::uint64_t, 3>(sizes.data(), 3));
  const VoxelType type = voxel_type(path, header.datatype);
  set_type(file, type);
  set_transform(file, path, header, options.prefer_qform);
  if (header.slope != 0 && std::isfinite(header.slope)) {
    if (!std::isfinite(header.intercept)) {
      throw InputError(fmt::format("{}: its scl_inter is not finite: the header is corrupt", path.string()));
    }
    file.volume.slope = header.slope;
    file.volume.intercept = header.intercept;
  }
  choose(path, "layer", 1, options.layer);
  const std::size_t frame = choose_frame(file, path, sizes, options.frame);
  stream = std::make_unique<ByteStream>(path, 0, coding_of(path));
  stream->skip(header.version == 1 ? size_1 : size_2);
  read_extensions(file, path, header, *stream);
  warn_of_several_names(file, path);

  const fs::path voxels = !header.pair ? path : image ? *image : image_of(path);
  if (header.pair) {
    file.data_files.push_back(image ? path : voxels);
  }
  stream = std::make_unique<ByteStream>(voxels, 0, coding_of(voxels));
  const std::uint64_t offset = voxel_offset(path, header);
  const std::uint64_t skipped = stream->skip(offset);
  if (skipped < offset) {
    throw InputError(
        fmt::format("{}: truncated: its voxels begin at byte {}, and it ends {} bytes before that; get the "
                    "whole file again",
                    voxels.string(), offset, offset - skipped));
  }
  read_voxels(file, *stream, type, header.big_endian,
              {{sizes[0], {}}, {sizes[1], {}}, {sizes[2], {}}, {sizes[3], frame}}, sink);
  return file;
}

}  // namespace tunica::volume_format
