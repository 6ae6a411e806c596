#pragma once

#include "tunica/io/mesh/mesh_file.hpp"

#include <span>
#include <string>
#include <string_view>

/// Inside lib/io: one reader per mesh format, from the file's bytes to positions in the file's own unit. `name` is the
/// file's name for messages. Each checks counts against the bytes there are before it allocates, and indices against
/// the vertices; finite coordinates are checked once, in read_mesh().
namespace tunica {

MeshFile read_ply(std::string_view bytes, const std::string& name);
MeshFile read_obj(std::string_view bytes, const std::string& name);
MeshFile read_stl(std::string_view bytes, const std::string& name);
MeshFile read_off(std::string_view bytes, const std::string& name);
MeshFile read_glb(std::string_view bytes, const std::string& name);

/// Notes the world axes that a comment, header or name in the file says anywhere, as in "3D Slicer output. SPACE=LPS":
/// "LPS" or "RAS", in any case and also in full ("right-anterior-superior"); not as a part of other words.
/// Errors: InputError when it says two of them, here or before.
void take_space(MeshFile& file, std::string_view text, const std::string& name);

/// The same, and the unit of length: "units mm", "UNITS=cm", "File units = millimeters". Units that are not understood
/// are left to read_mesh(). Errors: InputError as take_space().
void take_frame(MeshFile& file, std::string_view text, const std::string& name);

/// Gathers the faces of a file and turns them into triangles in the order of the faces.
class FaceCollector {
public:
  explicit FaceCollector(std::string name) : name_(std::move(name)) {}

  void reserve(std::size_t faces) { triangles_.reserve(faces); }
  void add(Index a, Index b, Index c) { triangles_.push_back({a, b, c}); }

  /// At least three corners; fewer are an InputError.
  void add(std::span<const Index> corners);

  [[nodiscard]] std::size_t faces() const { return triangles_.size() + polygons_.size(); }
  [[nodiscard]] bool has_polygons() const { return !polygons_.empty(); }

  /// Checks every index and gives `file`, whose vertices are there, its triangles. A convex polygon becomes a fan from
  /// its first corner, another one is cut ear by ear in the plane of its mean normal. Where no two faces share a vertex
  /// and vertices are nothing but positions, the file names places, not neighbours: they are joined by weld_exactly().
  /// Errors: InputError.
  void finish(MeshFile& file);

private:
  struct Polygon {
    std::size_t triangles_before;
    std::vector<Index> corners;
  };
  void check(std::span<const Index> corners, std::vector<bool>& used);

  std::string name_;
  std::size_t checked_ = 0;
  bool faces_are_apart_ = true;
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<Polygon> polygons_;
};

/// Makes one vertex of those whose coordinates are equal (0 = -0) and drops those that no triangle uses. The order of
/// the vertices is kept; no triangle is dropped.
void weld_exactly(TriangleMesh& mesh);

}  // namespace tunica
