// PLY, ASCII and binary, read strictly: what the header promises must be there to the byte, nothing may follow it, and
// no count is believed before the bytes that are left could hold it.
// Format: G. Turk, "The PLY polygon file format", 1994.
#include "core/error.hpp"
#include "core/progress.hpp"
#include "io/mesh_formats.hpp"
#include "io/text_scanner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

namespace tunica {
namespace {

constexpr std::size_t max_header = std::size_t{1} << 20;
constexpr std::size_t max_elements = 64;
constexpr std::size_t max_properties = 256;
constexpr std::size_t max_corners = 65535;

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

std::optional<Scalar> scalar_named(std::string_view name) {
  struct Names {
    std::string_view old_name, new_name;
    Scalar scalar;
  };
  static constexpr Names all[] = {{"char", "int8", Scalar::int8},        {"uchar", "uint8", Scalar::uint8},
                                  {"short", "int16", Scalar::int16},     {"ushort", "uint16", Scalar::uint16},
                                  {"int", "int32", Scalar::int32},       {"uint", "uint32", Scalar::uint32},
                                  {"float", "float32", Scalar::float32}, {"double", "float64", Scalar::float64}};
  for (const Names& names : all) {
    if (name == names.old_name || name == names.new_name) {
      return names.scalar;
    }
  }
  return {};
}

constexpr std::size_t size_of(Scalar scalar) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(scalar)];
}

constexpr bool is_whole(Scalar scalar) { return scalar < Scalar::float32; }

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

struct Property {
  std::string name;
  Scalar type = Scalar::float64;
  bool is_list = false;
  Scalar count_type = Scalar::uint8;
  std::size_t least_count = 0;  ///< of a list: fewer entries than these are refused while reading
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;

  [[nodiscard]] const Property* find(std::string_view wanted) const {
    const auto found = std::find_if(properties.begin(), properties.end(),
                                    [&](const Property& property) { return property.name == wanted; });
    return found == properties.end() ? nullptr : &*found;
  }

  /// Bytes that one record has at least (binary), or characters (ASCII: a digit and a separator per value).
  [[nodiscard]] std::size_t least_bytes(bool ascii) const {
    std::size_t bytes = 0;
    for (const Property& property : properties) {
      const std::size_t value = ascii ? 2 : size_of(property.type);
      bytes += property.is_list ? (ascii ? 2 : size_of(property.count_type)) + property.least_count * value : value;
    }
    return bytes;
  }
};

enum class Encoding { ascii, little_endian, big_endian };

struct Header {
  Encoding encoding = Encoding::ascii;
  std::vector<Element> elements;
  std::vector<std::string> comments;
  std::size_t bytes = 0;
  std::size_t lines = 0;

  [[nodiscard]] const Element* find(std::string_view name) const {
    const auto found =
        std::find_if(elements.begin(), elements.end(), [&](const Element& element) { return element.name == name; });
    return found == elements.end() ? nullptr : &*found;
  }
};

bool is_index_list(const Property& property) {
  return property.name == "vertex_indices" || property.name == "vertex_index";
}

class HeaderReader {
public:
  HeaderReader(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Header read() {
    if (line() != "ply") {
      throw InputError(fmt::format("{}: is not a PLY file (its first line is not \"ply\")", name_));
    }
    bool has_format = false;
    for (;;) {
      const std::string_view text = line();
      TextScanner words(text);
      words.next_line();
      const std::string_view keyword = words.token();
      if (keyword == "end_header") {
        break;
      }
      if (keyword == "format") {
        read_format(words);
        has_format = true;
      } else if (keyword == "comment") {
        header_.comments.emplace_back(words.rest());
      } else if (keyword == "element") {
        read_element(words);
      } else if (keyword == "property") {
        read_property(words);
      } else if (keyword != "obj_info" && !keyword.empty()) {
        fail(fmt::format("\"{}\" is no keyword of PLY", keyword.substr(0, 40)));
      }
    }
    if (!has_format) {
      fail("the header has no format line");
    }
    header_.bytes = position_;
    finish();
    return std::move(header_);
  }

private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", name_, header_.lines, what));
  }

  std::string_view line() {
    const std::size_t end = bytes_.substr(0, max_header).find('\n', position_);
    if (end == std::string_view::npos) {
      if (position_ == 0) {
        return {};
      }
      throw InputError(bytes_.size() > max_header
                           ? fmt::format("{}: no end_header within the first {} bytes", name_, max_header)
                           : fmt::format("{}: is truncated: it ends within the header, before end_header", name_));
    }
    std::string_view text = bytes_.substr(position_, end - position_);
    if (!text.empty() && text.back() == '\r') {
      text.remove_suffix(1);
    }
    position_ = end + 1;
    ++header_.lines;
    return text;
  }

  void read_format(TextScanner& words) {
    const std::string_view encoding = words.token();
    if (encoding == "ascii") {
      header_.encoding = Encoding::ascii;
    } else if (encoding == "binary_little_endian") {
      header_.encoding = Encoding::little_endian;
    } else if (encoding == "binary_big_endian") {
      header_.encoding = Encoding::big_endian;
    } else {
      fail("the format must be ascii, binary_little_endian or binary_big_endian");
    }
    if (words.token() != "1.0" || !words.at_line_end()) {
      fail("only version 1.0 of PLY is understood");
    }
  }

  void read_element(TextScanner& words) {
    Element element;
    element.name = words.token();
    const auto count = words.integer();
    if (element.name.empty() || !count || *count < 0 || !words.at_line_end()) {
      fail("an element needs a name and a count");
    }
    element.count = static_cast<std::size_t>(*count);
    if (header_.find(element.name) != nullptr) {
      fail(fmt::format("element {} is declared twice", element.name));
    }
    if (header_.elements.size() == max_elements) {
      fail(fmt::format("more than {} elements", max_elements));
    }
    header_.elements.push_back(std::move(element));
  }

  void read_property(TextScanner& words) {
    if (header_.elements.empty()) {
      fail("a property before the first element");
    }
    Element& element = header_.elements.back();
    Property property;
    std::string_view type = words.token();
    if (type == "list") {
      property.is_list = true;
      const auto count_type = scalar_named(words.token());
      if (!count_type || !is_whole(*count_type)) {
        fail("the length of a list must have a whole-number type");
      }
      property.count_type = *count_type;
      type = words.token();
    }
    const auto scalar = scalar_named(type);
    if (!scalar) {
      fail(fmt::format("\"{}\" is no type of PLY", type.substr(0, 40)));
    }
    property.type = *scalar;
    property.name = words.token();
    if (property.name.empty() || !words.at_line_end()) {
      fail("a property needs a type and a name");
    }
    if (element.find(property.name) != nullptr) {
      fail(fmt::format("property {} of element {} is declared twice", property.name, element.name));
    }
    if (element.properties.size() == max_properties) {
      fail(fmt::format("more than {} properties in element {}", max_properties, element.name));
    }
    element.properties.push_back(std::move(property));
  }

  /// What the mesh needs is declared, with types that can hold it.
  void finish() {
    const Element* vertex = header_.find("vertex");
    const Element* face = header_.find("face");
    if (vertex == nullptr || face == nullptr) {
      throw InputError(
          fmt::format("{}: has no element {}, so it holds no surface", name_, vertex == nullptr ? "vertex" : "face"));
    }
    for (const char* axis : {"x", "y", "z"}) {
      const Property* property = vertex->find(axis);
      if (property == nullptr || property->is_list) {
        throw InputError(fmt::format("{}: its vertices have no coordinate {}", name_, axis));
      }
    }
    int normals = 0;
    for (const char* axis : {"nx", "ny", "nz"}) {
      const Property* property = vertex->find(axis);
      normals += property != nullptr && !property->is_list ? 1 : 0;
    }
    if (normals != 0 && normals != 3) {
      throw InputError(fmt::format("{}: its normals need nx, ny and nz", name_));
    }
    int index_lists = 0;
    for (Element& element : header_.elements) {
      if (element.name != "face") {
        continue;
      }
      for (Property& property : element.properties) {
        if (is_index_list(property)) {
          ++index_lists;
          if (!property.is_list || !is_whole(property.type)) {
            throw InputError(fmt::format("{}: {} must be a list of whole numbers", name_, property.name));
          }
          property.least_count = 3;
        } else if (property.name == "corner_normals") {
          if (!property.is_list || is_whole(property.type)) {
            throw InputError(fmt::format("{}: corner_normals must be a list of 9 floats or doubles", name_));
          }
          property.least_count = 9;
        }
      }
    }
    if (index_lists != 1) {
      throw InputError(fmt::format("{}: its faces need one list vertex_indices, {} found", name_, index_lists));
    }
    if (vertex->count > max_index || face->count > max_index) {
      throw InputError(fmt::format("{}: promises {} vertices and {} faces, at most {} of each are understood", name_,
                                   vertex->count, face->count, max_index));
    }
  }

  std::string_view bytes_;
  const std::string& name_;
  Header header_;
  std::size_t position_ = 0;
};

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
    if (count < 0) {
      throw InputError(fmt::format("{}: {} {}: the list {} has the length {}", name_, element_->name, record_ - 1,
                                   property.name, count));
    }
    require(static_cast<std::size_t>(count) * size_of(property.type));
    return static_cast<std::size_t>(count);
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
    const auto left = static_cast<std::size_t>(end_ - at_);
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
      return static_cast<double>(*value);
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
    return static_cast<std::size_t>(*count);
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
    if (value < 0 || value > static_cast<double>(max_index)) {
      throw InputError(fmt::format("{}: {}: {:.0f} is no index of a vertex", name, body.place(), value));
    }
    corner = static_cast<Index>(value);
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
    needed += static_cast<double>(element.count) * static_cast<double>(element.least_bytes(ascii));
  }
  if (needed > static_cast<double>(left)) {
    throw InputError(fmt::format("{}: is truncated: {} bytes follow the header, at least {:.0f} bytes are missing",
                                 name, bytes.size() - header.bytes, needed - static_cast<double>(left)));
  }
}

void understand_comments(MeshFile& file, const std::string& name) {
  for (const std::string& comment : file.comments) {
    TextScanner words(comment);
    if (!words.next_line()) {
      continue;
    }
    const std::string_view first = words.token();
    if (first.starts_with("SPACE=")) {
      file.space = first.substr(6);
    } else if (first == "surface=comas") {
      file.patch = Patch::comas;
    } else if (first == "surface=watertight") {
      file.patch = Patch::watertight;
    } else if (first.starts_with("surface=")) {
      throw InputError(fmt::format("{}: \"{}\" is not understood, surface=comas or surface=watertight are", name,
                                   first.substr(0, 60)));
    } else if (first == "units") {
      const std::string_view unit = words.token();
      if (words.at_line_end() && !unit.empty()) {
        file.units = unit;
      }
    }
  }
}

}  // namespace

MeshFile read_ply(std::string_view bytes, const std::string& name) {
  static_assert(std::endian::native == std::endian::little || std::endian::native == std::endian::big);
  Header header = HeaderReader(bytes, name).read();
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
