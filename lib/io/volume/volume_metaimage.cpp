// MetaImage: https://itk.org/Wiki/ITK/MetaIO/Documentation

#include "tunica/core/error.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t largest_header = std::size_t{1} << 20;

struct Header {
  std::map<std::string, std::string, std::less<>> fields;  // by name as written
  std::uint64_t end = 0;                                   // first byte after the line ElementDataFile
};

// "Key = Value" lines; ElementDataFile is the last.
Header read_header(const fs::path& path) {
  Header header;
  ByteStream stream(path, 0, Coding::plain);
  std::string text(std::min<std::uint64_t>(largest_header, stream.most_bytes()), '\0');
  text.resize(stream.read(text.data(), text.size()));
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view line = std::string_view(text).substr(begin, end - begin);
    begin = std::min(end + 1, text.size());
    if (trimmed(line).empty()) {
      continue;
    }
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) {
      throw InputError(
          fmt::format("{}: the MetaImage header's line '{}' is not of the form 'Key = Value': it is corrupt",
                      path.string(), shown(trimmed(line))));
    }
    const std::string key(trimmed(line.substr(0, equals)));
    if (!header.fields.emplace(key, trimmed(line.substr(equals + 1))).second) {
      throw InputError(
          fmt::format("{}: the MetaImage header has the key '{}' twice: it is corrupt", path.string(), shown(key)));
    }
    if (key == "ElementDataFile") {
      header.end = begin;
      return header;
    }
  }
  throw InputError(fmt::format("{}: truncated: its MetaImage header has no ElementDataFile; get the whole file again",
                               path.string()));
}

std::string_view find(const Header& header, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    if (const auto at = header.fields.find(name); at != header.fields.end()) {
      return at->second;
    }
  }
  return {};
}

std::string_view require(const fs::path& path, const Header& header, std::string_view name) {
  const std::string_view value = find(header, {name});
  if (value.empty()) {
    throw InputError(fmt::format("{}: the MetaImage header has no {}: it is corrupt", path.string(), name));
  }
  return value;
}

[[noreturn]] void throw_field(const fs::path& path, std::string_view name, std::string_view value) {
  throw InputError(fmt::format("{}: the MetaImage header's {} is '{}', which makes no sense here: it is corrupt",
                               path.string(), name, shown(value)));
}

bool is_true(std::string_view text) { return !text.empty() && (text[0] == 'T' || text[0] == 't' || text[0] == '1'); }

std::vector<double> parse_numbers(const fs::path& path, std::string_view name, std::string_view text,
                                  std::size_t count) {
  std::vector<double> numbers;
  for (const std::string_view word : words(text)) {
    const auto number = parse_number(word);
    if (!number) {
      throw_field(path, name, text);
    }
    numbers.push_back(*number);
  }
  if (numbers.size() != count) {
    throw_field(path, name, text);
  }
  return numbers;
}

VoxelType voxel_type(const fs::path& path, std::string_view text) {
  // LONG has four bytes in a MetaImage, whatever the machine.
  static const std::map<std::string_view, VoxelType> types{
      {"MET_CHAR", VoxelType::int8},         {"MET_UCHAR", VoxelType::uint8},   {"MET_SHORT", VoxelType::int16},
      {"MET_USHORT", VoxelType::uint16},     {"MET_INT", VoxelType::int32},     {"MET_UINT", VoxelType::uint32},
      {"MET_LONG", VoxelType::int32},        {"MET_ULONG", VoxelType::uint32},  {"MET_LONG_LONG", VoxelType::int64},
      {"MET_ULONG_LONG", VoxelType::uint64}, {"MET_FLOAT", VoxelType::float32}, {"MET_DOUBLE", VoxelType::float64},
  };
  const auto at = types.find(text);
  if (at == types.end()) {
    throw InputError(fmt::format("{}: its voxels are of type '{}': convert them to integers, MET_FLOAT or MET_DOUBLE",
                                 path.string(), shown(text)));
  }
  return at->second;
}

// @param first  axis of space in the file; those before it are channels
void set_geometry(VolumeFile& file, const fs::path& path, const Header& header, std::size_t dimensions,
                  std::size_t first) {
  const auto numbers = [&](std::initializer_list<std::string_view> names, std::size_t count) {
    const std::string_view text = find(header, names);
    return text.empty() ? std::vector<double>() : parse_numbers(path, *names.begin(), text, count);
  };
  std::vector<double> spacing = numbers({"ElementSpacing", "ElementSize"}, dimensions);
  if (spacing.empty()) {
    file.warnings.push_back(
        {Weight::major, "voxel size", fmt::format("{}: has no ElementSpacing: 1 mm is taken", path.string())});
    spacing.assign(dimensions, 1);
  }
  std::vector<double> matrix = numbers({"TransformMatrix", "Rotation", "Orientation"}, dimensions * dimensions);
  file.transform = "TransformMatrix";
  if (matrix.empty()) {
    file.warnings.push_back(
        {Weight::minor, "world transform",
         fmt::format("{}: has no TransformMatrix: axes to the left, back and top are taken", path.string())});
    file.transform = "spacing";
    matrix.assign(dimensions * dimensions, 0);
    for (std::size_t i = 0; i < dimensions; ++i) {
      matrix[i * dimensions + i] = 1;
    }
  }
  std::vector<double> offset = numbers({"Offset", "Position", "Origin"}, dimensions);
  if (offset.empty()) {
    offset.assign(dimensions, 0);
  }
  // The matrix lists the direction of the first index axis, then of the second, …
  Eigen::Matrix<double, 3, 4> affine;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      affine(row, axis) = matrix[(first + axis) * dimensions + first + row] * spacing[first + axis];
    }
    affine(axis, 3) = offset[first + axis];
  }
  const std::string unit = lower_case(find(header, {"DistanceUnits"}));
  if (unit == "um" || unit == "cm" || unit == "m") {
    affine *= parse_length_unit(unit);
  } else if (!unit.empty() && unit != "mm" && unit != "?") {
    file.warnings.push_back({Weight::minor, "unit of length",
                             fmt::format("{}: unknown unit of length '{}' taken as mm", path.string(), shown(unit))});
  }
  set_affine(file, path, affine);
}

void set_intensity(VolumeFile& file, const fs::path& path, const Header& header) {
  if (const std::string_view text = find(header, {"ElementToIntensityFunctionSlope"}); !text.empty()) {
    const double slope = parse_numbers(path, "ElementToIntensityFunctionSlope", text, 1)[0];
    file.volume.slope = slope != 0 ? slope : 1;
  }
  if (const std::string_view text = find(header, {"ElementToIntensityFunctionOffset"}); !text.empty()) {
    file.volume.intercept = parse_numbers(path, "ElementToIntensityFunctionOffset", text, 1)[0];
  }
}

struct Place {
  fs::path path;
  std::uint64_t offset = 0;
};

Place voxel_place(const fs::path& path, const Header& header) {
  const std::string name(find(header, {"ElementDataFile"}));
  if (lower_case(name) == "local") {
    return {path, header.end};
  }
  if (name.starts_with("LIST") || name.find('%') != std::string::npos) {
    throw InputError(fmt::format("{}: its voxels are in several data files ('{}'): join them into one MetaImage",
                                 path.string(), shown(name)));
  }
  return {data_file_beside(path, name), 0};
}

void read_data(VolumeFile& file, const fs::path& path, const Header& header, const std::vector<Axis>& axes,
               VoxelType type, const SlabSink* sink) {
  Place place = voxel_place(path, header);
  if (place.path != path) {
    file.data_files.push_back(place.path);
  }
  const std::string_view binary = find(header, {"BinaryData"});
  const bool compressed = is_true(find(header, {"CompressedData"}));
  std::error_code error;
  const std::uintmax_t size = fs::file_size(place.path, error);
  if (const std::string_view text = find(header, {"HeaderSize"}); !text.empty()) {
    const auto skip = parse_count(text);
    const std::uint64_t bytes = stored_bytes(axes, type);
    if (text == "-1" && !compressed) {  // the voxels are the last bytes
      place.offset = !error && size >= bytes ? std::max<std::uint64_t>(place.offset, size - bytes) : place.offset;
    } else if (!skip || place.offset > std::numeric_limits<std::uint64_t>::max() - *skip) {
      throw_field(path, "HeaderSize", text);
    } else {
      place.offset += *skip;
    }
  }
  if (!binary.empty() && !is_true(binary)) {
    ByteStream stream(place.path, place.offset, Coding::plain);
    read_text_voxels(file, stream, type, axes, sink);
    return;
  }
  const bool big_endian = is_true(find(header, {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}));
  ByteStream stream(place.path, place.offset, compressed ? Coding::deflated : Coding::plain);
  read_voxels(file, stream, type, big_endian, axes, sink);
  // The stream says itself where it ends, and its checksum whether it is whole.
  if (const std::string_view text = find(header, {"CompressedDataSize"}); compressed && !text.empty() && text != "0") {
    const auto bytes = parse_count(text);
    if (!bytes) {
      throw_field(path, "CompressedDataSize", text);
    }
    const std::uint64_t left = error || size < place.offset ? 0 : size - place.offset;
    if (left < *bytes) {
      file.warnings.push_back(
          {Weight::note, "compressed size",
           fmt::format("{}: its header promises {} bytes of compressed voxels, and {} are there: all voxels are in "
                       "them, and their checksum is right",
                       place.path.string(), *bytes, left)});
    }
  }
}

}  // namespace

bool looks_like_metaimage(std::string_view head) {
  const std::string_view line = head.substr(0, head.find('\n'));
  const std::string_view key = trimmed(line.substr(0, line.find('=')));
  return line.find('=') != std::string_view::npos &&
         (key == "ObjectType" || key == "NDims" || key == "Comment" || key == "ObjectSubType" || key == "DimSize");
}

VolumeFile read_metaimage(const fs::path& path, const VolumeOptions& options, const SlabSink* sink) {
  const Header header = read_header(path);
  VolumeFile file;
  file.format = "MetaImage";
  const VoxelType type = voxel_type(path, require(path, header, "ElementType"));
  set_type(file, type);
  const std::string_view dimensions_text = require(path, header, "NDims");
  const std::size_t dimensions = dimensions_text == "3" ? 3 : dimensions_text == "4" ? 4 : 0;
  if (dimensions == 0) {
    throw InputError(fmt::format("{}: has {} dimensions, a volume has three (or four, with frames)", path.string(),
                                 shown(dimensions_text)));
  }
  const std::string_view channels = find(header, {"ElementNumberOfChannels"});
  if (!channels.empty() && channels != "1") {
    throw InputError(
        fmt::format("{}: has {} values per voxel: one value per voxel is needed", path.string(), shown(channels)));
  }
  std::vector<std::uint64_t> sizes;
  const std::string_view sizes_text = require(path, header, "DimSize");
  for (const std::string_view word : words(sizes_text)) {
    sizes.push_back(parse_count(word).value_or(0));
  }
  if (sizes.size() != dimensions || sizes.back() == 0) {
    throw_field(path, "DimSize", sizes_text);
  }
  const std::vector<std::uint64_t> stored = sizes;
  const std::size_t leading = options.frame ? 0 : leading_channels(stored);
  if (leading > 0) {
    file.warnings.push_back(channel_note(path, stored));
    std::rotate(sizes.begin(), sizes.begin() + static_cast<std::ptrdiff_t>(leading), sizes.end());
  }
  set_dims(file, path, std::span<const std::uint64_t, 3>(sizes.data(), 3));
  set_geometry(file, path, header, dimensions, leading);
  set_intensity(file, path, header);
  choose(path, "layer", 1, options.layer);
  const std::size_t frame = choose_frame(file, path, sizes, options.frame);
  read_data(file, path, header, {{sizes[0], {}}, {sizes[1], {}}, {sizes[2], {}}, {file.frames, frame}}, type, sink);
  return file;
}

}  // namespace tunica::volume_format
