#include "tunica/io/mesh/detail/ply_header.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/text_scanner.hpp"

#include <fmt/format.h>

namespace tunica::ply {
namespace {

constexpr std::size_t max_header = std::size_t{1} << 20;
constexpr std::size_t max_elements = 64;
constexpr std::size_t max_properties = 256;

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
      } else if (keyword == "comment" || keyword == "obj_info") {
        header_.comments.emplace_back(words.rest());
      } else if (keyword == "element") {
        read_element(words);
      } else if (keyword == "property") {
        read_property(words);
      } else if (!keyword.empty()) {
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
    element.count = narrow<std::size_t>(*count);
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
}  // namespace

bool is_index_list(const Property& property) {
  return property.name == "vertex_indices" || property.name == "vertex_index";
}

Header read_header(std::string_view bytes, const std::string& name) { return HeaderReader(bytes, name).read(); }

}  // namespace tunica::ply
