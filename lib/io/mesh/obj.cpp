// Wavefront OBJ: vertices and faces; everything else (texture, normals, groups, materials, lines) is passed over.
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/file/text_scanner.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

namespace tunica {
namespace {

class ObjReader {
public:
  ObjReader(std::string_view bytes, const std::string& name) : scanner_(bytes), name_(name), faces_(name) {}

  MeshFile read() {
    while (scanner_.next_line()) {
      const std::string_view keyword = scanner_.token();
      if (keyword == "v") {
        read_vertex();
      } else if (keyword == "f") {
        read_face();
      } else if (!keyword.empty() && !keyword.starts_with('v')) {  // comments, and names that may end in one
        const std::string_view rest = scanner_.rest();
        take_frame(file_, {keyword.data(), narrow<std::size_t>(rest.data() + rest.size() - keyword.data())}, name_);
      }
      if (++lines_ % 65536 == 0) {
        check_interrupt();
      }
    }
    faces_.finish(file_);
    return std::move(file_);
  }

private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", name_, scanner_.line(), what));
  }

  void read_vertex() {
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

  /// Corners as v, v/vt, v//vn or v/vt/vn, counted from 1, or backwards from -1; a `\` goes on in the next line.
  void read_face() {
    corners_.clear();
    while (true) {
      std::string_view corner = scanner_.token();
      if (corner == "\\") {
        if (!scanner_.next_line()) {
          fail("the file ends within a face");
        }
        continue;
      }
      if (corner.empty() || corner.front() == '#') {
        break;
      }
      corner = corner.substr(0, corner.find('/'));
      std::int64_t number = 0;
      const auto [stop, error] = std::from_chars(corner.data(), corner.data() + corner.size(), number);
      if (error != std::errc() || stop != corner.data() + corner.size() || number == 0) {
        fail("a corner of a face is no index of a vertex, counted from 1");
      }
      const std::int64_t index = number > 0 ? number - 1 : narrow<std::int64_t>(file_.mesh.vertices.size()) + number;
      if (index < 0 || index > narrow<std::int64_t>(max_index)) {
        fail(fmt::format("{} is no index of a vertex", number));
      }
      corners_.push_back(narrow<Index>(index));
    }
    faces_.add(corners_);
  }

  TextScanner scanner_;
  const std::string& name_;
  FaceCollector faces_;
  MeshFile file_;
  std::vector<Index> corners_;
  std::size_t lines_ = 0;
};

}  // namespace

MeshFile read_obj(std::string_view bytes, const std::string& name) { return ObjReader(bytes, name).read(); }

}  // namespace tunica
