#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/core/quantity.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/io/mesh/mesh_file.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <array>
#include <filesystem>
#include <optional>
#include <vector>

namespace tunica::chain {

/// What is written of a distance between surfaces, as far as it is wanted.
struct MapFiles {
  std::optional<std::filesystem::path> map, picture;  ///< PLY with the distance as `quality`, mm; PNG
  std::optional<LengthTolerance> picture_range;       ///< where colours end; none: the largest distance
  std::optional<std::filesystem::path> curved;        ///< the curved surface, see write_surface()

  /// Says that they are going to be written.
  void announce(const Context& context) const;
};

/// A surface in triangles small enough to be coloured, and the edges of its facets or shells.
struct ErrorMap {
  TriangleMesh mesh;
  std::vector<double> distances;           ///< mm, #V
  std::vector<std::array<Vec3, 2>> edges;  ///< mm
};

/// @param most  triangles, about; errors and cost: as vertex_distances()
ErrorMap map_of_shells(const ShellMesh& shell, const ClosestPoint& to, std::size_t most);
/// @param diagonal  mm: triangles are no longer than a two-hundredth of it
ErrorMap map_of_facets(const TriangleMesh& mesh, const ClosestPoint& to, std::size_t most, double diagonal);

/// The curved surface to within 0.001 % of a diagonal (mm). Errors: OutputError.
void write_curved(const std::filesystem::path& path, const ShellMesh& shell, double diagonal, const PlyOptions& ply);

/// Files that are written together: unless keep() is called in the end, those that are there go, for of a run that
/// failed nothing is to look finished.
class FilesTogether {
public:
  FilesTogether() = default;
  FilesTogether(const FilesTogether&) = delete;
  FilesTogether& operator=(const FilesTogether&) = delete;
  ~FilesTogether();
  void add(const std::filesystem::path& path) { written_.push_back(path); }
  void keep() { written_.clear(); }

private:
  std::vector<std::filesystem::path> written_;
};

/// Writes map and picture of a distance. Errors: OutputError.
/// @param look  title, caption, quantity and diagonal; the lines are those of the map
void write_map(const MapFiles& out, const ErrorMap& map, PictureOptions look, const PlyOptions& ply,
               const Context& context, FilesTogether& written);

}  // namespace tunica::chain
