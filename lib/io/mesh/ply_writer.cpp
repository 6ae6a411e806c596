#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/io/file/output_file.hpp"
#include "tunica/io/mesh/mesh_file.hpp"

#include <fmt/format.h>

#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace tunica {
namespace {

static_assert(std::endian::native == std::endian::little, "the writer copies numbers as they stand in memory");

/// Appends to NAME.part through a small buffer, so that a large mesh is not held twice.
class Writer {
public:
  explicit Writer(const std::filesystem::path& path)
      : path_(path), file_(std::fopen(path.c_str(), "wb"), &std::fclose) {
    if (!file_) {
      fail();
    }
    buffer_.reserve(capacity);
  }

  void text(std::string_view text) {
    if (buffer_.size() + text.size() > capacity) {
      flush();
    }
    buffer_ += text;
  }

  template <typename T>
  void number(T value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    text({bytes, sizeof value});
  }

  void vector(const Vec3& v) {
    number(v.x());
    number(v.y());
    number(v.z());
  }

  void close() {
    flush();
    if (std::fclose(file_.release()) != 0) {
      fail();
    }
  }

private:
  static constexpr std::size_t capacity = std::size_t{1} << 20;

  void flush() {
    if (std::fwrite(buffer_.data(), 1, buffer_.size(), file_.get()) != buffer_.size()) {
      fail();
    }
    buffer_.clear();
  }

  [[noreturn]] void fail() const {
    throw OutputError(fmt::format("{}: cannot be written: {}", path_.string(), file_error()));
  }

  std::filesystem::path path_;
  OpenFile file_;
  std::string buffer_;
};

/// What a file of ours may hold; empty parts are left out.
struct Content {
  const std::vector<Vec3>& vertices;
  const std::vector<std::array<Index, 3>>& triangles;
  const std::vector<Vec3>* normals = nullptr;
  const std::vector<std::array<Vec3, 3>>* corner_normals = nullptr;
  const char* property = nullptr;  ///< of the vertices
  const std::vector<double>* values = nullptr;
  std::optional<Patch> patch = {};
};

/// A comment is one line of the header.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ') {
      c = ' ';
    }
  }
  return text;
}

std::string ply_header(const Content& content, const PlyOptions& options) {
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  header += fmt::format("comment SPACE={}\n", one_line(options.space));
  if (options.millimetres) {
    header += "comment units mm\n";
  }
  if (content.patch) {
    header += fmt::format("comment surface={}\n", *content.patch == Patch::comas ? "comas" : "watertight");
  }
  for (const std::string& comment : options.comments) {
    header += fmt::format("comment {}\n", one_line(comment));
  }
  header += fmt::format("element vertex {}\nproperty double x\nproperty double y\nproperty double z\n",
                        content.vertices.size());
  if (content.normals != nullptr) {
    header += "property double nx\nproperty double ny\nproperty double nz\n";
  }
  if (content.property != nullptr) {
    header += fmt::format("property double {}\n", content.property);
  }
  header += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", content.triangles.size());
  if (content.corner_normals != nullptr) {
    header += "property list uchar double corner_normals\n";
  }
  return header + "end_header\n";
}

void write(const std::filesystem::path& path, const Content& content, const PlyOptions& options) {
  TUNICA_ASSERT(content.vertices.size() <= max_index && content.triangles.size() <= max_index);
  TUNICA_ASSERT(content.normals == nullptr || content.normals->size() == content.vertices.size());
  TUNICA_ASSERT(content.values == nullptr || content.values->size() == content.vertices.size());
  TUNICA_ASSERT(content.corner_normals == nullptr || content.corner_normals->size() == content.triangles.size());
  OutputFile output(path, options.overwrite);
  Writer writer(output.partial_path());
  writer.text(ply_header(content, options));
  for (std::size_t v = 0; v < content.vertices.size(); ++v) {
    writer.vector(content.vertices[v]);
    if (content.normals != nullptr) {
      writer.vector((*content.normals)[v]);
    }
    if (content.values != nullptr) {
      writer.number((*content.values)[v]);
    }
  }
  for (std::size_t t = 0; t < content.triangles.size(); ++t) {
    writer.number(std::uint8_t{3});
    for (const Index corner : content.triangles[t]) {
      writer.number(narrow<std::int32_t>(corner));
    }
    if (content.corner_normals != nullptr) {
      writer.number(std::uint8_t{9});
      for (const Vec3& normal : (*content.corner_normals)[t]) {
        writer.vector(normal);
      }
    }
  }
  writer.close();
  if (options.partial) {
    output.keep_partial();
  } else {
    output.commit();
  }
}

}  // namespace

void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyOptions& options) {
  write(path, {.vertices = mesh.vertices, .triangles = mesh.triangles}, options);
}

void write_ply(const std::filesystem::path& path, const ShellMesh& shell, const PlyOptions& options) {
  write_ply(path, shell, {}, options);
}

void write_ply(const std::filesystem::path& path, const ShellMesh& shell, const std::vector<double>& thickness,
               const PlyOptions& options) {
  write(path,
        {.vertices = shell.vertices,
         .triangles = shell.triangles,
         .normals = &shell.normals,
         .corner_normals = shell.corner_normals.empty() ? nullptr : &shell.corner_normals,
         .property = thickness.empty() ? nullptr : "thickness",
         .values = thickness.empty() ? nullptr : &thickness,
         .patch = shell.patch},
        options);
}

void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const std::vector<double>& quality,
               const PlyOptions& options) {
  write(path, {.vertices = mesh.vertices, .triangles = mesh.triangles, .property = "quality", .values = &quality},
        options);
}

}  // namespace tunica
