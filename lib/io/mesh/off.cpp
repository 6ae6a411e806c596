// Geomview OFF, ASCII, with or without normals, colours and texture coordinates, which are passed over.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

namespace tunica {
namespace {

constexpr std::size_t least_vertex_bytes = 6;  // "0 0 0\n"
constexpr std::size_t least_face_bytes = 8;    // "3 0 1 2\n"

class OffReader {
public:
  OffReader(std::string_view bytes, const std::string& name) : scanner_(bytes), name_(name) {}

  MeshFile read() {
    const auto [vertices, faces] = read_header();
    file_.mesh.vertices.reserve(vertices);
    for (std::size_t v = 0; v < vertices; ++v) {
      next_line("vertex", v);
      Vec3 vertex;
      for (int axis = 0; axis < 3; ++axis) {
        const auto value = scanner_.number();
        if (!value) {
          fail("a vertex needs three numbers");
        }
        vertex[axis] = *value;
      }
      file_.mesh.vertices.push_back(vertex);
    }
    FaceCollector collector(name_);
    collector.reserve(faces);
    std::vector<Index> corners;
    for (std::size_t f = 0; f < faces; ++f) {
      next_line("face", f);
      read_face(corners);
      collector.add(corners);
    }
    if (next_content()) {
      fail("text follows the last face, so the counts of the header are wrong");
    }
    collector.finish(file_);
    return std::move(file_);
  }

private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", name_, scanner_.line(), what));
  }

  bool next_content() {
    while (scanner_.next_line()) {
      if (scanner_.rest().front() != '#') {
        return true;
      }
      take_frame(file_, scanner_.rest(), name_);
    }
    return false;
  }

  void next_line(const char* what, std::size_t number) {
    if (!next_content()) {
      throw InputError(fmt::format("{}: is truncated: it ends before {} {}", name_, what, number));
    }
    if (number % 65536 == 0) {
      check_interrupt();
    }
  }

  /// Counts of vertices and faces.
  std::pair<std::size_t, std::size_t> read_header() {
    if (!next_content()) {
      throw InputError(fmt::format("{}: is no OFF file", name_));
    }
    std::string_view mark = scanner_.token();
    for (const std::string_view prefix : {"ST", "C", "N"}) {
      if (mark.starts_with(prefix)) {
        mark.remove_prefix(prefix.size());
      }
    }
    if (mark != "OFF") {
      fail("an OFF file of triangles in space begins with OFF (or COFF, NOFF, STOFF)");
    }
    if (scanner_.rest().starts_with("BINARY")) {
      fail("binary OFF is not understood: save it as ASCII, or as PLY");
    }
    if (!scanner_.at_line_end() && scanner_.rest().front() == '#') {
      take_frame(file_, scanner_.rest(), name_);
    }
    if ((scanner_.at_line_end() || scanner_.rest().front() == '#') && !next_content()) {
      throw InputError(fmt::format("{}: is truncated: it ends within the header", name_));
    }
    const auto vertices = scanner_.integer();
    const auto faces = scanner_.integer();
    if (!vertices || !faces || *vertices < 0 || *faces < 0) {
      fail("the numbers of vertices and faces are expected");
    }
    const double needed = real(*vertices) * least_vertex_bytes + real(*faces) * least_face_bytes;
    const double left = real(scanner_.remaining()) + 1;  // the last line may lack its end
    if (needed > left) {
      throw InputError(
          fmt::format("{}: is truncated: {} vertices and {} faces are promised, at least {:.0f} bytes are "
                      "missing",
                      name_, *vertices, *faces, needed - left));
    }
    return {narrow<std::size_t>(*vertices), narrow<std::size_t>(*faces)};
  }

  void read_face(std::vector<Index>& corners) {
    const auto count = scanner_.integer();
    if (!count || *count < 3) {
      fail("a face needs the number of its corners, at least 3");
    }
    corners.clear();
    for (std::int64_t c = 0; c < *count; ++c) {
      const auto index = scanner_.integer();
      if (!index || *index < 0 || *index > narrow<std::int64_t>(max_index)) {
        fail("a corner of a face is no index of a vertex, counted from 0");
      }
      corners.push_back(narrow<Index>(*index));
    }
  }

  TextScanner scanner_;
  const std::string& name_;
  MeshFile file_;
};

}  // namespace

MeshFile read_off(std::string_view bytes, const std::string& name) { return OffReader(bytes, name).read(); }

}  // namespace tunica
