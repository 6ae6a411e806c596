// STL, binary and ASCII. A binary file may begin with "solid" too, so its length decides: 84 bytes and 50 per triangle.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <cstring>

namespace tunica {
namespace {

constexpr std::size_t header_bytes = 84;
constexpr std::size_t triangle_bytes = 50;

std::size_t promised_triangles(std::string_view bytes) {
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, sizeof count);
  return count;
}

MeshFile read_binary(std::string_view bytes, const std::string& name) {
  if (bytes.size() < header_bytes) {
    throw InputError(
        fmt::format("{}: is truncated: {} bytes, a binary STL file has at least {}", name, bytes.size(), header_bytes));
  }
  const std::size_t count = promised_triangles(bytes);
  const std::size_t expected = header_bytes + count * triangle_bytes;
  if (bytes.size() < expected) {
    throw InputError(fmt::format("{}: is truncated: {} triangles are promised, {} bytes are missing", name, count,
                                 expected - bytes.size()));
  }
  if (bytes.size() > expected) {
    throw InputError(fmt::format("{}: {} bytes follow the {} triangles that its header promises", name,
                                 bytes.size() - expected, count));
  }
  if (count > max_index / 3) {
    throw InputError(fmt::format("{}: has {} triangles, at most {} are understood", name, count, max_index / 3));
  }
  MeshFile file;
  take_frame(file, bytes.substr(0, 80), name);
  file.mesh.vertices.reserve(3 * count);
  file.mesh.triangles.reserve(count);
  for (std::size_t t = 0; t < count; ++t) {
    std::array<float, 12> values;  // a normal, which the corners' order gives as well, and three corners
    std::memcpy(values.data(), bytes.data() + header_bytes + t * triangle_bytes, sizeof values);
    const auto first = narrow<Index>(3 * t);
    for (std::size_t corner = 1; corner <= 3; ++corner) {
      file.mesh.vertices.emplace_back(values[3 * corner], values[3 * corner + 1], values[3 * corner + 2]);
    }
    file.mesh.triangles.push_back({first, first + 1, first + 2});
    if (t % 65536 == 0) {
      check_interrupt();
    }
  }
  return file;
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    c = static_cast<char>(c >= 'A' && c <= 'Z' ? c + 32 : c);
  }
  return lower;
}

class AsciiReader {
public:
  AsciiReader(std::string_view bytes, const std::string& name) : scanner_(bytes), name_(name) {}

  MeshFile read() {
    MeshFile file;
    bool inside = false;  // a file may hold several solids
    while (scanner_.next_line()) {
      const std::string keyword = lower_case(scanner_.token());
      if (!inside) {
        if (keyword != "solid") {
          fail("\"solid\" is expected");
        }
        take_frame(file, scanner_.rest(), name_);
        inside = true;
      } else if (keyword == "endsolid") {
        take_frame(file, scanner_.rest(), name_);
        inside = false;
      } else if (keyword == "facet") {
        read_facet(file.mesh);
      } else {
        fail("\"facet\" or \"endsolid\" is expected");
      }
    }
    if (inside) {
      throw InputError(fmt::format("{}: is truncated: it ends after {} triangles, before endsolid", name_,
                                   file.mesh.triangles.size()));
    }
    return file;
  }

private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", name_, scanner_.line(), what));
  }

  void expect_line(std::string_view first, std::string_view second = {}) {
    if (!scanner_.next_line()) {
      throw InputError(fmt::format("{}: is truncated: it ends within a facet", name_));
    }
    if (lower_case(scanner_.token()) != first || (!second.empty() && lower_case(scanner_.token()) != second)) {
      fail(fmt::format("\"{}{}{}\" is expected", first, second.empty() ? "" : " ", second));
    }
  }

  void read_facet(TriangleMesh& mesh) {
    if (mesh.triangles.size() >= max_index / 3) {
      fail("more triangles than are understood");
    }
    const auto first = narrow<Index>(mesh.vertices.size());
    expect_line("outer", "loop");
    for (int corner = 0; corner < 3; ++corner) {
      expect_line("vertex");
      Vec3 vertex;
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = scanner_.number();
        if (!value) {
          fail("a vertex needs three numbers");
        }
        vertex[axis] = *value;
      }
      mesh.vertices.push_back(vertex);
    }
    expect_line("endloop");
    expect_line("endfacet");
    mesh.triangles.push_back({first, first + 1, first + 2});
    if (mesh.triangles.size() % 65536 == 0) {
      check_interrupt();
    }
  }

  TextScanner scanner_;
  const std::string& name_;
};

bool looks_like_text(std::string_view bytes) {
  return lower_case(bytes.substr(0, 5)) == "solid" && bytes.substr(0, 512).find('\0') == std::string_view::npos;
}

}  // namespace

MeshFile read_stl(std::string_view bytes, const std::string& name) {
  const bool has_binary_length =
      bytes.size() >= header_bytes && bytes.size() == header_bytes + promised_triangles(bytes) * triangle_bytes;
  const bool is_text = !has_binary_length && looks_like_text(bytes);
  MeshFile file = is_text ? AsciiReader(bytes, name).read() : read_binary(bytes, name);
  weld_exactly(file.mesh);
  return file;
}

}  // namespace tunica
