// PLY, ASCII and binary, read strictly: what the header promises must be there to the byte, nothing may follow it, and
// no count is believed before the bytes that are left could hold it.
// Format: G. Turk, "The PLY polygon file format", 1994.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"
#include "tunica/io/mesh/detail/ply_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace tunica {
namespace {

using namespace ply;

constexpr std::size_t max_corners = 65535;  // of one face

bool fits(Scalar scalar, std::int64_t value) {
  switch (scalar) {
    case Scalar::int8:
      return value >= -128 && value <= 127;
    case Scalar::uint8:
      return value >= 0 && value <= 255;
    case Scalar::int16:
      return value >= -32768 && value <= 32767;
    case Scalar::uint16:
      return value >= 0 && value <= 65535;
    case Scalar::int32:
      return value >= std::numeric_limits<std::int32_t>::min() && value <= std::numeric_limits<std::int32_t>::max();
    default:
      return value >= 0 && value <= std::numeric_limits<std::uint32_t>::max();
  }
}

/// One scalar at `at`, in the encoding's byte order.
template <bool swap>
double decode(const char* at, Scalar type) {
  const auto as = [at]<typename T>(T value) {
    std::array<char, sizeof value> bytes;
    std::memcpy(bytes.data(), at, bytes.size());
    if constexpr (swap) {
      std::reverse(bytes.begin(), bytes.end());
    }
    std::memcpy(&value, bytes.data(), bytes.size());
    return static_cast<double>(value);
  };
  switch (type) {
    case Scalar::int8:
      return as(std::int8_t{});
    case Scalar::uint8:
      return as(std::uint8_t{});
    case Scalar::int16:
      return as(std::int16_t{});
    case Scalar::uint16:
      return as(std::uint16_t{});
    case Scalar::int32:
      return as(std::int32_t{});
    case Scalar::uint32:
      return as(std::uint32_t{});
    case Scalar::float32:
      return as(float{});
    default:
      return as(double{});
  }
}

/// Delivers the values of one record after the other from the binary body.
template <bool swap>
class BinaryBody {
public:
  BinaryBody(std::string_view bytes, const Header& header, const std::string& name)
      : at_(bytes.data() + header.bytes), end_(bytes.data() + bytes.size()), header_(header), name_(name) {}

  void begin_element(const Element& element) {
    element_ = &element;
    record_ = 0;
  }
  void begin_record() {
    if (++record_ % 65536 == 0) {
      check_interrupt();
    }
  }
  void end_record() {}

  double scalar(const Property& property) {
    const std::size_t size = size_of(property.type);
    require(size);
    const double value = decode<swap>(at_, property.type);
    at_ += size;
    return value;
  }

  std::size_t list(const Property& property) {
    require(size_of(property.count_type));
    const double count = decode<swap>(at_, property.count_type);
    at_ += size_of(property.count_type);
    if (!(count >= 0 && count <= real(max_index))) {
      throw InputError(fmt::format("{}: {} {}: the list {} has the length {}", name_, element_->name, record_ - 1,
                                   property.name, count));
    }
    const auto size = truncated<std::size_t>(count);
    require(size * size_of(property.type));
    return size;
  }

  double entry(const Property& property) {
    const double value = decode<swap>(at_, property.type);
    at_ += size_of(property.type);
    return value;
  }

  void skip(const Property& property, std::size_t count) {
    require(count * size_of(property.type));
    at_ += count * size_of(property.type);
  }

  [[nodiscard]] std::string place() const { return fmt::format("{} {}", element_->name, record_ - 1); }

  void finish() const {
    if (at_ != end_) {
      throw InputError(
          fmt::format("{}: {} bytes follow the last record, so the counts of its header are wrong", name_, end_ - at_));
    }
  }

private:
  void require(std::size_t size) const {
    const std::size_t left = end_ - at_;
    if (size <= left) {
      return;
    }
    std::size_t missing = size - left;
    bool later = false;
    for (const Element& element : header_.elements) {
      if (later) {
        missing += element.count * element.least_bytes(false);
      } else if (&element == element_) {
        missing += (element.count - record_) * element.least_bytes(false);
        later = true;
      }
    }
    throw InputError(
        fmt::format("{}: is truncated: it ends in {}, at least {} bytes are missing", name_, place(), missing));
  }

  const char* at_;
  const char* end_;
  const Header& header_;
  const std::string& name_;
  const Element* element_ = nullptr;
  std::size_t record_ = 0;
};

/// The same from an ASCII body: a line per record.
class AsciiBody {
public:
  AsciiBody(std::string_view bytes, const Header& header, const std::string& name)
      : scanner_(bytes.substr(header.bytes), header.lines), header_(header), name_(name) {}

  void begin_element(const Element& element) {
    element_ = &element;
    record_ = 0;
  }

  void begin_record() {
    if (!scanner_.next_line()) {
      std::size_t missing = element_->count - record_;
      bool later = false;
      for (const Element& element : header_.elements) {
        missing += later ? element.count : 0;
        later = later || &element == element_;
      }
      throw InputError(fmt::format("{}: is truncated: it ends before {} {}, {} lines are missing", name_,
                                   element_->name, record_, missing));
    }
    if (++record_ % 65536 == 0) {
      check_interrupt();
    }
  }

  void end_record() {
    if (!scanner_.at_line_end()) {
      fail("more values than the header declares");
    }
  }

  double scalar(const Property& property) {
    if (is_whole(property.type)) {
      const auto value = scanner_.integer();
      if (!value || !fits(property.type, *value)) {
        fail(fmt::format("{}: a whole number of the type declared is expected", property.name));
      }
      return real(*value);
    }
    const auto value = scanner_.number();
    if (!value) {
      fail(fmt::format("{}: a number is expected", property.name));
    }
    return *value;
  }

  std::size_t list(const Property& property) {
    const auto count = scanner_.integer();
    if (!count || *count < 0 || !fits(property.count_type, *count)) {
      fail(fmt::format("{}: the length of a list is expected", property.name));
    }
    return narrow<std::size_t>(*count);
  }

  double entry(const Property& property) { return scalar(property); }

  void skip(const Property& property, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      scalar(property);
    }
  }

  [[nodiscard]] std::string place() const { return fmt::format("line {}", scanner_.line()); }

  void finish() {
    if (scanner_.next_line()) {
      throw InputError(fmt::format("{}: line {}: text follows the last record, so the counts of the header are wrong",
                                   name_, scanner_.line()));
    }
  }

private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", name_, scanner_.line(), what));
  }

  TextScanner scanner_;
  const Header& header_;
  const std::string& name_;
  const Element* element_ = nullptr;
  std::size_t record_ = 0;
};

/// Where the value of a vertex property goes: a number in an array of doubles, `stride` apart.
struct Column {
  double* data = nullptr;
  std::size_t stride = 1;
};

template <typename Body>
void read_vertices(Body& body, const Element& element, MeshFile& file) {
  const std::size_t count = element.count;
  file.mesh.vertices.resize(count);
  if (element.find("nx") != nullptr) {
    file.normals.resize(count);
  }
  std::vector<std::vector<double>> further(element.properties.size());
  std::vector<Column> columns(element.properties.size());
  for (std::size_t p = 0; p < element.properties.size(); ++p) {
    const Property& property = element.properties[p];
    if (property.is_list || count == 0) {
      continue;
    }
    const std::size_t axis = std::string_view("xyz").find(property.name.back());
    if (property.name.size() == 1 && axis != std::string_view::npos) {
      columns[p] = {file.mesh.vertices[0].data() + axis, 3};
    } else if (property.name.size() == 2 && property.name[0] == 'n' && axis != std::string_view::npos) {
      columns[p] = {file.normals[0].data() + axis, 3};
    } else {
      further[p].resize(count);
      columns[p] = {further[p].data(), 1};
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    body.begin_record();
    for (std::size_t p = 0; p < columns.size(); ++p) {
      const Property& property = element.properties[p];
      if (property.is_list) {
        body.skip(property, body.list(property));
      } else {
        columns[p].data[i * columns[p].stride] = body.scalar(property);
      }
    }
    body.end_record();
  }
  for (std::size_t p = 0; p < columns.size(); ++p) {
    if (!further[p].empty()) {
      file.vertex_properties.emplace_back(element.properties[p].name, std::move(further[p]));
    }
  }
}

template <typename Body>
void read_corners(Body& body, const Property& property, const std::string& name, std::vector<Index>& corners) {
  const std::size_t count = body.list(property);
  if (count < 3 || count > max_corners) {
    throw InputError(
        fmt::format("{}: {}: a face of {} corners, 3 to {} are understood", name, body.place(), count, max_corners));
  }
  corners.resize(count);
  for (Index& corner : corners) {
    const double value = body.entry(property);
    if (!(value >= 0 && value <= real(max_index))) {
      throw InputError(fmt::format("{}: {}: {:.0f} is no index of a vertex", name, body.place(), value));
    }
    corner = truncated<Index>(value);
  }
}

template <typename Body>
std::array<Vec3, 3> read_corner_normals(Body& body, const Property& property, const std::string& name) {
  if (const std::size_t count = body.list(property); count != 9) {
    throw InputError(fmt::format("{}: {}: corner_normals needs 9 numbers, {} found", name, body.place(), count));
  }
  std::array<Vec3, 3> normals;
  for (Vec3& normal : normals) {
    for (int axis = 0; axis < 3; ++axis) {
      normal[axis] = body.entry(property);
    }
  }
  return normals;
}

template <typename Body>
void read_faces(Body& body, const Element& element, const std::string& name, FaceCollector& faces, MeshFile& file) {
  const bool has_corner_normals = element.find("corner_normals") != nullptr;
  faces.reserve(element.count);
  file.corner_normals.reserve(has_corner_normals ? element.count : 0);
  std::vector<Index> corners;
  for (std::size_t i = 0; i < element.count; ++i) {
    body.begin_record();
    for (const Property& property : element.properties) {
      if (is_index_list(property)) {
        read_corners(body, property, name, corners);
        faces.add(corners);
      } else if (property.name == "corner_normals") {
        file.corner_normals.push_back(read_corner_normals(body, property, name));
      } else if (property.is_list) {
        body.skip(property, body.list(property));
      } else {
        body.scalar(property);
      }
    }
    body.end_record();
  }
  if (has_corner_normals && faces.has_polygons()) {
    throw InputError(fmt::format("{}: corner_normals belong to triangles, but it has faces of more corners", name));
  }
}

template <typename Body>
void skip_element(Body& body, const Element& element) {
  for (std::size_t i = 0; i < element.count; ++i) {
    body.begin_record();
    for (const Property& property : element.properties) {
      body.skip(property, property.is_list ? body.list(property) : 1);
    }
    body.end_record();
  }
}

template <typename Body>
void read_body(Body body, const Header& header, const std::string& name, MeshFile& file) {
  FaceCollector faces(name);
  for (const Element& element : header.elements) {
    if (element.properties.empty()) {
      continue;
    }
    body.begin_element(element);
    if (element.name == "vertex") {
      read_vertices(body, element, file);
    } else if (element.name == "face") {
      read_faces(body, element, name, faces, file);
    } else {
      skip_element(body, element);
    }
  }
  body.finish();
  faces.finish(file);
}

/// No allocation before this: the bytes that are there can hold what the header promises.
void require_bytes(std::string_view bytes, const Header& header, const std::string& name) {
  const bool ascii = header.encoding == Encoding::ascii;
  const std::size_t left = bytes.size() - header.bytes + (ascii ? 1 : 0);  // the last line may lack its end
  double needed = 0;
  for (const Element& element : header.elements) {
    needed += real(element.count) * real(element.least_bytes(ascii));
  }
  if (needed > real(left)) {
    throw InputError(fmt::format("{}: is truncated: {} bytes follow the header, at least {:.0f} bytes are missing",
                                 name, bytes.size() - header.bytes, needed - real(left)));
  }
}

void understand_comments(MeshFile& file, const std::string& name) {
  for (const std::string& comment : file.comments) {
    take_frame(file, comment, name);
    TextScanner words(comment);
    if (!words.next_line()) {
      continue;
    }
    const std::string_view first = words.token();
    if (first.starts_with("SPACE=") && !file.space) {
      file.space = first.substr(6);  // other axes, which it goes on to say
    } else if (first == "surface=comas") {
      file.patch = Patch::comas;
    } else if (first == "surface=watertight") {
      file.patch = Patch::watertight;
    } else if (first.starts_with("surface=")) {
      throw InputError(fmt::format("{}: \"{}\" is not understood, surface=comas or surface=watertight are", name,
                                   first.substr(0, 60)));
    } else if (first == "voxel") {
      for (int axis = 0; axis < 3; ++axis) {
        const auto edge = parse_number(words.token());
        if (edge && *edge > 0 && std::isfinite(*edge)) {
          file.voxel = std::max(file.voxel.value_or(0), *edge);
          file.shortest_voxel = std::min(file.shortest_voxel.value_or(*edge), *edge);
        }
      }
    } else if (first == "units") {
      const std::string_view unit = words.token();
      if (words.at_line_end() && !unit.empty() && !file.units) {
        file.units = unit.substr(0, 20);  // no unit of length, which read_mesh() says
      }
    }
  }
}

}  // namespace

MeshFile read_ply(std::string_view bytes, const std::string& name) {
  static_assert(std::endian::native == std::endian::little || std::endian::native == std::endian::big);
  ply::Header header = ply::read_header(bytes, name);
  MeshFile file;
  file.comments = std::move(header.comments);
  understand_comments(file, name);
  require_bytes(bytes, header, name);
  if (header.encoding == Encoding::ascii) {
    read_body(AsciiBody(bytes, header, name), header, name, file);
  } else if ((header.encoding == Encoding::little_endian) == (std::endian::native == std::endian::little)) {
    read_body(BinaryBody<false>(bytes, header, name), header, name, file);
  } else {
    read_body(BinaryBody<true>(bytes, header, name), header, name, file);
  }
  return file;
}

}  // namespace tunica
