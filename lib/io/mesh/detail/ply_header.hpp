#pragma once

#include "tunica/core/types.hpp"

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

/// The header of a PLY file. Inside lib/io.
namespace tunica::ply {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

/// Bytes of one value.
constexpr std::size_t size_of(Scalar scalar) {
  constexpr std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(scalar)];
}

/// Whether it is a type of whole numbers.
constexpr bool is_whole(Scalar scalar) { return scalar < Scalar::float32; }

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

/// Whether the property holds the corners of a face, under either of its usual names.
bool is_index_list(const Property& property);

/// Reads and checks the header at the beginning of a file's bytes: known types, one list of corners, counts that can be
/// understood. `name` is the file's name for messages. Errors: InputError.
Header read_header(std::string_view bytes, const std::string& name);

}  // namespace tunica::ply
