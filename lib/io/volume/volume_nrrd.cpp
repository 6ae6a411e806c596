// NRRD: https://teem.sourceforge.net/nrrd/format.html, and Teem's own reader where that leaves things open
// Segments in .seg.nrrd: https://slicer.readthedocs.io/en/latest/developer_guide/modules/segmentations.html

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/volume/detail/volume_format.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <ranges>

namespace tunica::volume_format {
namespace fs = std::filesystem;
namespace {

constexpr std::size_t largest_header = std::size_t{16} << 20;

enum class Role { space, layer, frame, values };

struct AxisInfo {
  std::uint64_t size = 1;
  std::string kind;               // lower case, empty when unknown
  std::optional<Vec3> direction;  // of a space axis, in the file's space and unit
  std::optional<double> spacing;
  std::optional<double> min;  // where the axis begins and ends
  std::optional<double> max;
  bool node = false;  // samples lie on the ends, not half a sample within them
  Role role = Role::space;
};

struct Header {
  std::map<std::string, std::string> fields;  // by name without spaces, lower case
  std::map<std::uint64_t, Segment> segments;
  std::uint64_t end = 0;  // where attached data begins
  bool complete = false;  // ended by an empty line
};

// Takes one of a segment's keys. A segment is called as its identifier where it has no name.
void set_segment(const fs::path& path, Segment& segment, std::string_view line, std::string_view key,
                 std::string_view value) {
  if (key == "Name" || (key == "ID" && segment.name.empty())) {
    segment.name = value;
  }
  const auto label = key == "LabelValue" ? parse_number(value) : std::nullopt;
  const auto layer = key == "Layer" ? parse_count(value) : std::nullopt;
  if ((key == "LabelValue" && !label) || (key == "Layer" && !layer)) {
    throw InputError(fmt::format("{}: the NRRD header's line '{}' has no such number: it is corrupt", path.string(),
                                 shown(trimmed(line))));
  }
  segment.label = label.value_or(segment.label);
  segment.layer = layer ? layer : segment.layer;
}

// The header's lines, up to the empty one or the end of the file.
Header read_header(const fs::path& path) {
  Header header;
  ByteStream stream(path, 0, Coding::plain);
  std::string text;
  std::size_t line_begin = 0;
  bool first = true;
  for (;;) {
    const std::size_t line_end = text.find('\n', line_begin);
    if (line_end == std::string::npos) {
      const std::size_t size = text.size();
      if (size > largest_header) {
        throw InputError(fmt::format("{}: its NRRD header has no end within {} MiB: it is corrupt", path.string(),
                                     largest_header >> 20));
      }
      text.resize(size + 65536);
      text.resize(size + stream.read(text.data() + size, 65536));
      if (text.size() > size) {
        continue;
      }
      if (line_begin < text.size()) {
        text += '\n';  // the last line of a detached header
        continue;
      }
      return header;
    }
    const std::string_view line = std::string_view(text).substr(line_begin, line_end - line_begin);
    line_begin = line_end + 1;
    if (line.empty() || line == "\r") {
      header.end = line_begin;
      header.complete = true;
      return header;
    }
    if (first || line.front() == '#') {
      first = false;
      continue;
    }
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos &&
        (header.fields.contains("datafile") || header.fields.contains("data_file"))) {
      continue;  // a name in a list of data files, which voxel_place() refuses
    }
    if (colon == std::string_view::npos) {
      throw InputError(fmt::format("{}: the NRRD header's line '{}' is neither a field nor a key: it is corrupt",
                                   path.string(), shown(trimmed(line))));
    }
    const std::string_view name = line.substr(0, colon);
    if (line.substr(colon).starts_with(":=")) {
      const std::string_view value = trimmed(line.substr(colon + 2));
      const std::size_t underscore = name.find('_');
      if (!name.starts_with("Segment") || underscore == std::string_view::npos) {
        continue;
      }
      const auto number = parse_count(name.substr(7, underscore - 7));
      const std::string_view key = name.substr(underscore + 1);
      if (!number) {
        continue;
      }
      Segment& segment = header.segments[*number];
      set_segment(path, segment, line, key, value);
      continue;
    }
    std::string key = lower_case(name);
    std::erase(key, ' ');
    if (!header.fields.emplace(key, trimmed(line.substr(colon + 1))).second) {
      throw InputError(
          fmt::format("{}: the NRRD header has the field '{}' twice: it is corrupt", path.string(), shown(name)));
    }
  }
}

const std::string* find(const Header& header, const std::string& name) {
  const auto at = header.fields.find(name);
  return at == header.fields.end() ? nullptr : &at->second;
}

const std::string& require(const fs::path& path, const Header& header, const std::string& name) {
  const std::string* value = find(header, name);
  if (value == nullptr) {
    throw InputError(fmt::format("{}: the NRRD header has no field '{}': it is corrupt", path.string(), name));
  }
  return *value;
}

[[noreturn]] void throw_field(const fs::path& path, const std::string& name, std::string_view value) {
  throw InputError(fmt::format("{}: the NRRD header's field '{}' is '{}', which makes no sense here: it is corrupt",
                               path.string(), name, shown(value)));
}

VoxelType voxel_type(const fs::path& path, const std::string& text) {
  static const std::map<std::string, VoxelType> types{
      {"signed char", VoxelType::int8},
      {"int8", VoxelType::int8},
      {"int8_t", VoxelType::int8},
      {"uchar", VoxelType::uint8},
      {"unsigned char", VoxelType::uint8},
      {"uint8", VoxelType::uint8},
      {"uint8_t", VoxelType::uint8},
      {"short", VoxelType::int16},
      {"short int", VoxelType::int16},
      {"signed short", VoxelType::int16},
      {"signed short int", VoxelType::int16},
      {"int16", VoxelType::int16},
      {"int16_t", VoxelType::int16},
      {"ushort", VoxelType::uint16},
      {"unsigned short", VoxelType::uint16},
      {"unsigned short int", VoxelType::uint16},
      {"uint16", VoxelType::uint16},
      {"uint16_t", VoxelType::uint16},
      {"int", VoxelType::int32},
      {"signed int", VoxelType::int32},
      {"int32", VoxelType::int32},
      {"int32_t", VoxelType::int32},
      {"uint", VoxelType::uint32},
      {"unsigned int", VoxelType::uint32},
      {"uint32", VoxelType::uint32},
      {"uint32_t", VoxelType::uint32},
      {"longlong", VoxelType::int64},
      {"long long", VoxelType::int64},
      {"long long int", VoxelType::int64},
      {"signed long long", VoxelType::int64},
      {"signed long long int", VoxelType::int64},
      {"int64", VoxelType::int64},
      {"int64_t", VoxelType::int64},
      {"ulonglong", VoxelType::uint64},
      {"unsigned long long", VoxelType::uint64},
      {"unsigned long long int", VoxelType::uint64},
      {"uint64", VoxelType::uint64},
      {"uint64_t", VoxelType::uint64},
      {"float", VoxelType::float32},
      {"double", VoxelType::float64},
  };
  const auto at = types.find(lower_case(text));
  if (at == types.end()) {
    throw InputError(fmt::format("{}: its voxels are of type '{}': convert them to integers or to float or double",
                                 path.string(), shown(text)));
  }
  return at->second;
}

// "(a,b,c) none (d,e,f)"; a vector may have spaces inside.
std::vector<std::optional<std::vector<double>>> parse_vectors(const fs::path& path, const std::string& name,
                                                              std::string_view text) {
  std::vector<std::optional<std::vector<double>>> vectors;
  for (std::string_view rest = trimmed(text); !rest.empty(); rest = trimmed(rest)) {
    if (rest.starts_with("none")) {
      vectors.emplace_back();
      rest.remove_prefix(4);
      continue;
    }
    const std::size_t end = rest.find(')');
    if (rest.front() != '(' || end == std::string_view::npos) {
      throw_field(path, name, text);
    }
    std::vector<double> vector;
    for (std::string_view inside = rest.substr(1, end - 1);;) {
      const std::size_t comma = inside.find(',');
      const auto number = parse_number(std::string(trimmed(inside.substr(0, comma))));
      if (!number) {
        throw_field(path, name, text);
      }
      vector.push_back(*number);
      if (comma == std::string_view::npos) {
        break;
      }
      inside.remove_prefix(comma + 1);
    }
    vectors.emplace_back(std::move(vector));
    rest.remove_prefix(end + 1);
  }
  return vectors;
}

// What turns the file's world axes into left, posterior, superior; none for a space without anatomy. The format knows
// three such spaces; others are written in the same way, an initial or a word for each axis, and mean what they say.
std::optional<Mat3> to_lps(std::string space) {
  constexpr std::array<std::array<std::string_view, 2>, 3> ends{
      {{"left", "right"}, {"posterior", "anterior"}, {"superior", "inferior"}}};
  space = lower_case(space);
  if (space.ends_with("-time")) {
    space.resize(space.size() - 5);
  } else if (space.size() == 4 && space.back() == 't') {
    space.pop_back();
  }
  std::vector<std::string> words;
  if (space.size() == 3) {
    for (const char initial : space) {
      words.emplace_back(1, initial);
    }
  } else {
    for (const auto word : space | std::views::split('-')) {
      words.emplace_back(word.begin(), word.end());
    }
  }
  Mat3 turn = Mat3::Zero();
  for (std::size_t axis = 0; axis < words.size() && words.size() == 3; ++axis) {
    for (std::size_t world = 0; world < 3; ++world) {
      for (const std::string_view end : ends[world]) {
        if (words[axis] == end || words[axis] == end.substr(0, 1)) {
          turn(narrow<Eigen::Index>(world), narrow<Eigen::Index>(axis)) = end == ends[world].front() ? 1 : -1;
        }
      }
    }
  }
  return std::abs(turn.determinant()) == 1 ? std::optional(turn) : std::nullopt;
}

std::vector<AxisInfo> parse_axes(const fs::path& path, const Header& header) {
  const std::string& dimension_text = require(path, header, "dimension");
  const auto dimension = parse_count(dimension_text);
  if (!dimension || *dimension < 1 || *dimension > 16) {
    throw_field(path, "dimension", dimension_text);
  }
  std::vector<AxisInfo> axes(*dimension);
  const auto each = [&](const std::string& name, const auto& use) {
    const std::string* text = find(header, name);
    if (text == nullptr) {
      return;
    }
    const auto parts = words(*text);
    if (parts.size() != axes.size()) {
      throw_field(path, name, *text);
    }
    for (std::size_t i = 0; i < axes.size(); ++i) {
      if (!use(axes[i], parts[i])) {
        throw_field(path, name, *text);
      }
    }
  };
  require(path, header, "sizes");
  each("sizes", [](AxisInfo& axis, std::string_view word) {
    const auto size = parse_count(word);
    axis.size = size.value_or(0);
    return axis.size > 0;
  });
  each("kinds", [](AxisInfo& axis, std::string_view word) {
    axis.kind = lower_case(word);
    if (axis.kind == "???" || axis.kind == "none") {
      axis.kind.clear();
    }
    return true;
  });
  const auto number_or_nan = [](std::string_view word, std::optional<double>& number) {
    number = parse_number(word);
    return number.has_value() || lower_case(word) == "nan";
  };
  each("spacings", [&](AxisInfo& axis, std::string_view word) { return number_or_nan(word, axis.spacing); });
  each("axismins", [&](AxisInfo& axis, std::string_view word) { return number_or_nan(word, axis.min); });
  each("axismaxs", [&](AxisInfo& axis, std::string_view word) { return number_or_nan(word, axis.max); });
  for (const char* name : {"centers", "centerings"}) {
    each(name, [](AxisInfo& axis, std::string_view word) {
      axis.node = lower_case(word) == "node";
      return true;
    });
  }
  if (const std::string* text = find(header, "spacedirections")) {
    const auto vectors = parse_vectors(path, "space directions", *text);
    if (vectors.size() != axes.size()) {
      throw_field(path, "space directions", *text);
    }
    for (std::size_t i = 0; i < axes.size(); ++i) {
      if (!vectors[i]) {
        continue;
      }
      const std::vector<double>& v = *vectors[i];
      // A space with time has vectors of four numbers; the time axis has no direction in space.
      const bool time = v.size() == 4 && v[0] == 0 && v[1] == 0 && v[2] == 0;
      if (v.size() != 3 && !(v.size() == 4 && (time || v[3] == 0))) {
        throw InputError(fmt::format("{}: its space has {} dimensions, three are needed", path.string(), v.size()));
      }
      if (time) {
        axes[i].kind = "time";
      } else {
        axes[i].direction = Vec3(v[0], v[1], v[2]);
      }
    }
  }
  return axes;
}

Role role_of_kind(const std::string& kind, bool leading) {
  if (kind == "time") {
    return Role::frame;
  }
  if (kind == "list" || (kind.empty() && leading)) {
    return Role::layer;
  }
  return kind.empty() || kind == "domain" || kind == "space" ? Role::frame : Role::values;
}

std::vector<std::uint64_t> sizes_of(const std::vector<AxisInfo>& axes) {
  std::vector<std::uint64_t> sizes;
  for (const AxisInfo& axis : axes) {
    sizes.push_back(axis.size);
  }
  return sizes;
}

// Axes of one sample that stand before three of space, and that nothing says to be space themselves.
void set_leading_channels(VolumeFile& file, const fs::path& path, std::vector<AxisInfo>& axes) {
  const auto sizes = sizes_of(axes);
  const std::size_t channels = leading_channels(sizes);
  for (std::size_t i = 0; i < channels; ++i) {
    axes[i].kind = "list";
  }
  if (channels > 0) {
    file.warnings.push_back(channel_note(path, sizes));
  }
}

// Which three axes are space, and what the others are.
void set_roles(const fs::path& path, std::vector<AxisInfo>& axes, bool has_directions) {
  std::size_t space = 0;
  for (AxisInfo& axis : axes) {
    const bool spatial_kind = axis.kind.empty() || axis.kind == "domain" || axis.kind == "space";
    const bool spatial = has_directions ? axis.direction.has_value() : spatial_kind;
    axis.role = spatial ? Role::space : role_of_kind(axis.kind, &axis == &axes.front());
    space += spatial ? 1 : 0;
  }
  // Without directions an axis of unknown kind after three of space is a time axis.
  for (AxisInfo& axis : axes) {
    const std::size_t before = narrow<std::size_t>(&axis - axes.data());
    if (!has_directions && space > 3 && axis.role == Role::space && before >= 3) {
      axis.role = Role::frame;
      --space;
    }
  }
  if (space != 3) {
    throw InputError(fmt::format("{}: has {} axes in space, a volume has three", path.string(), space));
  }
  std::array<int, 4> count{};
  for (const AxisInfo& axis : axes) {
    if (axis.size == 1) {
      continue;
    }
    if (axis.role == Role::values) {
      throw InputError(fmt::format("{}: has {} values per voxel (kind {}): one value per voxel is needed",
                                   path.string(), axis.size, shown(axis.kind)));
    }
    if (++count.at(static_cast<std::size_t>(axis.role)) > 1 && axis.role != Role::space) {
      throw InputError(fmt::format("{}: has two list or two time axes: split the file", path.string()));
    }
  }
}

// Millimetres per unit of the vectors or spacings: all axes must agree.
double unit_size(const fs::path& path, const Header& header, bool has_directions, std::vector<Warning>& warnings) {
  const std::string name = has_directions ? "spaceunits" : "units";
  const std::string* text = find(header, name);
  if (text == nullptr) {
    return 1;
  }
  double unit = 0;
  std::string_view rest = *text;
  while (!rest.empty()) {
    const std::size_t open = rest.find('"');
    const std::size_t close = open == std::string_view::npos ? open : rest.find('"', open + 1);
    if (close == std::string_view::npos) {
      break;
    }
    const std::string word = lower_case(trimmed(rest.substr(open + 1, close - open - 1)));
    rest.remove_prefix(close + 1);
    const bool micron = word == "um" || word == "micron" || word == "microns" || word == "\xc2\xb5m";
    const double size = word == "mm" || word == "millimeter" || word == "millimetre" ? 1
                        : micron                                                     ? 0.001
                        : word == "cm"                                               ? 10
                        : word == "m" || word == "meter" || word == "metre"          ? 1000
                                                                                     : 0;
    if (size == 0) {
      const bool none = word.empty() || word == "none" || word == "???" || word == "s" || word == "ms";
      if (!none) {
        warnings.push_back({Weight::minor, "unit of length",
                            fmt::format("{}: unknown unit of length '{}' taken as mm", path.string(), shown(word))});
      }
      continue;
    }
    if (unit != 0 && unit != size) {
      throw InputError(fmt::format("{}: its axes have different units of length ({})", path.string(), shown(*text)));
    }
    unit = size;
  }
  return unit == 0 ? 1 : unit;
}

// Spacing of an axis that is not oriented: stated, or from its two ends; none where it is unknown.
std::optional<double> spacing_of(const AxisInfo& axis) {
  if (axis.spacing || !axis.min || !axis.max) {
    return axis.spacing;
  }
  const std::uint64_t steps = axis.node ? axis.size - 1 : axis.size;
  return steps > 0 ? std::optional((*axis.max - *axis.min) / real(steps)) : std::nullopt;
}

// The place of the first samples by the axes' minima, as nrrdOriginCalculate(): of a cell its middle. None where one of
// them has none.
std::optional<Vec3> origin_of_minima(const std::vector<AxisInfo>& axes) {
  Vec3 origin = Vec3::Zero();
  Eigen::Index row = 0;
  for (const AxisInfo& axis : axes) {
    if (axis.role != Role::space) {
      continue;
    }
    if (!axis.min) {
      return {};
    }
    origin[row++] = *axis.min + (axis.node ? 0 : spacing_of(axis).value_or(1) / 2);
  }
  return origin;
}

void set_geometry(VolumeFile& file, const fs::path& path, const Header& header, const std::vector<AxisInfo>& axes,
                  bool has_directions) {
  Eigen::Matrix<double, 3, 4> affine = Eigen::Matrix<double, 3, 4>::Zero();
  Eigen::Index column = 0;
  std::size_t unknown = 0;  // spacings
  for (const AxisInfo& axis : axes) {
    if (axis.role != Role::space) {
      continue;
    }
    unknown += spacing_of(axis) ? 0 : 1;
    if (has_directions) {
      affine.col(column) = *axis.direction;
    } else {
      affine(column, column) = spacing_of(axis).value_or(1);
    }
    ++column;
  }
  file.transform = has_directions ? "space directions" : "spacings";
  const std::string* space = find(header, "space");
  const auto turn = space != nullptr ? to_lps(*space) : std::nullopt;
  const bool has_origin = find(header, "spaceorigin") != nullptr;
  if (!has_directions) {
    file.warnings.push_back(
        {Weight::minor, "world transform",
         fmt::format("{}: has no space directions: voxels are placed by their {}{}, with axes {}", path.string(),
                     unknown == 3   ? "number (spacing 1 mm)"
                     : unknown == 0 ? (origin_of_minima(axes) ? "axis mins and spacings" : "spacings")
                                    : fmt::format("spacings ({} of 3 unknown: 1 mm)", unknown),
                     has_origin ? " and the space origin" : " alone",
                     turn ? fmt::format("of its space '{}'", shown(*space)) : "to the left, back and top")});
  }
  if (const std::string* text = find(header, "spaceorigin")) {
    const auto vectors = parse_vectors(path, "space origin", *text);
    if (vectors.size() != 1 || !vectors[0] || vectors[0]->size() < 3 || vectors[0]->size() > 4) {
      throw_field(path, "space origin", *text);
    }
    affine.col(3) = Vec3((*vectors[0])[0], (*vectors[0])[1], (*vectors[0])[2]);
  } else if (const auto origin = has_directions ? std::nullopt : origin_of_minima(axes)) {
    affine.col(3) = *origin;
  } else if (has_directions) {
    file.warnings.push_back(
        {Weight::minor, "no origin",
         fmt::format(
             "{}: has no space origin: the first voxel is placed at 0, and the surface is as far off as that is "
             "wrong; add the field to the header",
             path.string())});
  }
  affine *= unit_size(path, header, has_directions, file.warnings);
  if (turn) {
    affine = *turn * affine;
  } else if (has_directions) {
    file.warnings.push_back(
        {Weight::minor, "world transform",
         fmt::format("{}: {}: taken as left-posterior-superior", path.string(),
                     space != nullptr ? fmt::format("its space '{}' is not tied to the body", shown(*space))
                                      : "names no space")});
  }
  set_affine(file, path, affine);
}

// The file's segments. Those of Slicer before 4.11 name no layer: the segment's number is its layer.
std::vector<Segment> segments_of(const Header& header, std::uint64_t layers) {
  std::vector<Segment> segments;
  for (const auto& [number, stored] : header.segments) {
    Segment segment = stored;
    const std::uint64_t layer = segment.layer.value_or(layers == 1 ? 0 : number);
    segment.layer = layer < layers ? std::optional<std::size_t>(layer) : std::nullopt;
    segments.push_back(std::move(segment));
  }
  return segments;
}

// "aorta (label 1 of layer 0), …"
std::string list_of(const std::vector<Segment>& segments) {
  constexpr std::size_t most = 400;
  std::string text;
  for (const Segment& segment : segments) {
    if (text.size() > most) {
      return text + ", ...";
    }
    text += fmt::format("{}{} (label {} of {})", text.empty() ? "" : ", ",
                        segment.name.empty() ? "unnamed" : shown(segment.name), segment.label,
                        segment.layer ? fmt::format("layer {}", *segment.layer) : "no layer that it has");
  }
  return text;
}

// The segments that are wanted: what has a + in it is several, unless one is called so.
std::vector<std::string> parts_of(const VolumeFile& file, std::string_view wanted) {
  if (std::ranges::any_of(file.segments, [&](const Segment& segment) { return segment.name == wanted; })) {
    return {std::string(wanted)};
  }
  std::vector<std::string> parts;
  for (bool more = true; more;) {
    const std::size_t plus = std::min(wanted.find('+'), wanted.size());
    parts.emplace_back(trimmed(wanted.substr(0, plus)));
    more = plus < wanted.size();
    wanted.remove_prefix(std::min(plus + 1, wanted.size()));
  }
  return parts;
}

// The layer of the segment that is wanted, none where the segments do not say.
std::optional<std::size_t> layer_of_segment(const VolumeFile& file, const fs::path& path, const std::string& wanted,
                                            std::optional<std::size_t> chosen) {
  const auto value = parse_number(wanted);
  const std::vector<std::string> parts = parts_of(file, wanted);
  std::vector<Segment> meant;
  std::vector<std::size_t> layers;
  for (const Segment& segment : file.segments) {
    if (std::ranges::any_of(parts, [&](const std::string& part) {
          const auto label = parse_number(part);
          return label ? segment.label == *label : segment.name == part;
        })) {
      meant.push_back(segment);
      if (!segment.layer) {
        throw InputError(
            fmt::format("{}: does not say in which of its {} layers the segment {} is: its segments are {}",
                        path.string(), file.layers, shown(segment.name), list_of(file.segments)));
      }
      layers.push_back(*segment.layer);
    }
  }
  std::sort(layers.begin(), layers.end());
  layers.erase(std::unique(layers.begin(), layers.end()), layers.end());
  if (chosen && !layers.empty() && !value && std::ranges::find(layers, *chosen) == layers.end()) {
    throw InputError(
        fmt::format("{}: --layer {} does not hold the segment '{}', which is in layer {}: leave --layer out",
                    path.string(), *chosen, shown(wanted), fmt::join(layers, " and ")));
  }
  if (!chosen && layers.size() > 1) {
    throw InputError(fmt::format("{}: '{}' means segments in several layers: {}; pass {}", path.string(), shown(wanted),
                                 list_of(meant),
                                 value              ? "--label NAME, or --layer too"
                                 : parts.size() > 1 ? "one of them, for a surface is made of one layer"
                                                    : "--layer too"));
  }
  return chosen || layers.empty() ? chosen : layers.front();
}

std::size_t choose_layer(const VolumeFile& file, const fs::path& path, const VolumeOptions& options) {
  std::optional<std::size_t> layer = options.layer;
  if (options.segment && !file.segments.empty() && file.layers > 1) {
    layer = layer_of_segment(file, path, *options.segment, options.layer);
    if (!layer && !parse_number(*options.segment)) {
      throw InputError(fmt::format("{}: has no segment '{}': its segments are {}", path.string(),
                                   shown(*options.segment), list_of(file.segments)));
    }
  }
  return choose(path, "layer", file.layers, layer,
                file.segments.empty() ? "" : fmt::format(", or a segment by --label NAME: {}", list_of(file.segments)));
}

// Byte at which the line after `lines` lines begins.
std::uint64_t offset_after_lines(const fs::path& path, std::uint64_t offset, std::uint64_t lines) {
  ByteStream stream(path, offset, Coding::plain);
  std::vector<char> buffer(65536);
  std::uint64_t at = offset;
  while (lines > 0) {
    const std::size_t got = stream.read(buffer.data(), buffer.size());
    if (got == 0) {
      throw InputError(fmt::format("{}: truncated: it ends {} lines before its voxels; get the whole file again",
                                   path.string(), lines));
    }
    for (std::size_t i = 0; i < got && lines > 0; ++i) {
      ++at;
      lines -= buffer[i] == '\n' ? 1 : 0;
    }
  }
  return at;
}

struct Place {
  fs::path path;
  std::uint64_t offset = 0;
};

Place voxel_place(const fs::path& path, const Header& header) {
  Place place{path, header.end};
  const std::string* detached = find(header, "datafile");
  if (detached == nullptr) {
    detached = find(header, "data_file");
  }
  if (detached != nullptr) {
    const auto parts = words(*detached);
    if (parts.empty() || parts[0] == "LIST" || detached->find('%') != std::string::npos) {
      throw InputError(fmt::format("{}: its voxels are in several data files ('{}'): join them into one NRRD file",
                                   path.string(), shown(*detached)));
    }
    place = {data_file_beside(path, *detached), 0};
  } else if (!header.complete) {
    throw InputError(
        fmt::format("{}: truncated: it ends within its NRRD header; get the whole file again", path.string()));
  }
  if (const std::string* skip = find(header, "lineskip")) {
    const auto lines = parse_count(*skip);
    if (!lines) {
      throw_field(path, "line skip", *skip);
    }
    place.offset = offset_after_lines(place.path, place.offset, *lines);
  }
  return place;
}

void read_data(VolumeFile& file, const fs::path& path, const Header& header, const std::vector<Axis>& axes,
               VoxelType type, const SlabSink* sink) {
  Place place = voxel_place(path, header);
  if (place.path != path) {
    file.data_files.push_back(place.path);
  }
  const std::string encoding = lower_case(require(path, header, "encoding"));
  const std::string skip_text = find(header, "byteskip") != nullptr ? *find(header, "byteskip") : "0";
  // -1: the voxels are the last bytes; -1 - N: N bytes follow them.
  const bool from_end = skip_text.starts_with('-');
  const auto skip = parse_count(from_end ? skip_text.substr(1) : skip_text);
  if (!skip || (from_end && *skip == 0)) {
    throw_field(path, "byte skip", skip_text);
  }
  if (encoding == "ascii" || encoding == "text" || encoding == "txt") {
    if (from_end) {
      throw_field(path, "byte skip", skip_text);
    }
    ByteStream stream(place.path, place.offset, Coding::plain);
    stream.skip(*skip);
    read_text_voxels(file, stream, type, axes, sink);
    return;
  }
  const bool gzip = encoding == "gzip" || encoding == "gz";
  if (!gzip && encoding != "raw") {
    throw InputError(
        fmt::format("{}: its encoding is '{}': save it with encoding raw or gzip", path.string(), shown(encoding)));
  }
  bool big_endian = false;
  if (size_of(type) > 1) {
    const std::string endian = lower_case(require(path, header, "endian"));
    if (endian != "little" && endian != "big") {
      throw_field(path, "endian", endian);
    }
    big_endian = endian == "big";
  }
  // Lines are skipped in the file, bytes in what is inflated of it.
  const auto coding = gzip ? Coding::deflated : Coding::plain;
  std::uint64_t before = *skip;
  if (from_end) {
    const std::uint64_t behind = *skip - 1;
    const std::uint64_t voxels = stored_bytes(axes, type);
    ByteStream whole(place.path, place.offset, coding);
    const std::uint64_t size = whole.skip(std::numeric_limits<std::int64_t>::max());
    if (size < voxels || size - voxels < behind) {
      throw InputError(fmt::format("{}: truncated: it holds {} bytes, and {} of voxels with {} behind them are wanted",
                                   place.path.string(), size, voxels, behind));
    }
    before = size - voxels - behind;
  }
  ByteStream stream(place.path, place.offset, coding);
  stream.skip(before);
  // What follows is said by the header.
  read_voxels(file, stream, type, big_endian, axes, sink, from_end);
}

}  // namespace

bool looks_like_nrrd(std::string_view head) { return head.starts_with("NRRD000"); }

VolumeFile read_nrrd(const fs::path& path, const VolumeOptions& options, const SlabSink* sink) {
  const Header header = read_header(path);
  VolumeFile file;
  file.format = "NRRD";
  const VoxelType type = voxel_type(path, require(path, header, "type"));
  set_type(file, type);

  std::vector<AxisInfo> axes = parse_axes(path, header);
  const bool has_directions = find(header, "spacedirections") != nullptr;
  if (!has_directions && !options.frame) {
    set_leading_channels(file, path, axes);
  }
  set_roles(path, axes, has_directions);
  std::vector<std::uint64_t> dims;
  for (const AxisInfo& axis : axes) {
    if (axis.role == Role::space) {
      dims.push_back(axis.size);
    } else if (axis.role == Role::layer) {
      file.layers *= axis.size;
    } else {
      file.frames *= axis.size;
    }
  }
  set_dims(file, path, std::span<const std::uint64_t, 3>(dims.data(), 3));
  set_geometry(file, path, header, axes, has_directions);

  file.segments = segments_of(header, file.layers);
  const std::size_t layer = choose_layer(file, path, options);
  const bool as_stored = axes.size() == 4 && axes.back().role == Role::frame && axes.back().kind != "time";
  const std::size_t frame = as_stored ? choose_frame(file, path, sizes_of(axes), options.frame)
                                      : choose(path, "frame", file.frames, options.frame);
  std::vector<Axis> stored;
  for (const AxisInfo& axis : axes) {
    std::optional<std::uint64_t> pick;
    if (axis.role != Role::space) {
      pick = axis.size == 1 ? 0 : axis.role == Role::layer ? layer : frame;
    }
    stored.push_back({axis.size, pick});
  }
  for (const Segment& segment : file.segments) {
    if (segment.layer == layer && !segment.name.empty()) {
      file.volume.label_names.emplace_back(segment.label, segment.name);
    }
  }
  warn_of_several_names(file, path);
  read_data(file, path, header, stored, type, sink);
  return file;
}

}  // namespace tunica::volume_format
