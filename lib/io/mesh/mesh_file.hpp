// io/mesh: formats of meshes, a file each.
#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

/// A mesh file as read, positions scaled to mm.
struct MeshFile {
  TriangleMesh mesh;
  std::vector<Vec3> normals;                        ///< empty, or #V unit vectors (PLY nx ny nz)
  std::vector<std::array<Vec3, 3>> corner_normals;  ///< empty, or #F
  std::optional<Patch> patch;                       ///< `surface=` comment
  std::optional<std::string> units;                 ///< what holds by the file: "mm", …
  bool unit_unknown = false;                        ///< an OBJ, STL or OFF that says none, and none was given
  bool unit_assumed = false;                        ///< a PLY that says none: its numbers are taken for mm
  std::optional<double> voxel;                      ///< mm, longest edge: `voxel` comment, of the image behind it
  std::optional<double> shortest_voxel;             ///< mm, its shortest edge
  std::optional<std::string> space;   ///< world axes, "LPS" or "RAS": `SPACE=` in a comment, header or name
  std::vector<std::string> comments;  ///< all PLY comments, for provenance
  std::vector<std::pair<std::string, std::vector<double>>> vertex_properties;  ///< further scalar ones, e.g. thickness
};

/// Reads PLY (ASCII, binary of both byte orders), OBJ, STL, OFF and GLB. The format is known by content, then by
/// extension. Polygons are split: a convex one into a fan, another ear by ear. PLY, OBJ and OFF keep their vertices as
/// they are, also those no face uses; what comes as single triangles (STL, GLB, or a file whose faces share no vertex)
/// is joined where coordinates are equal, without tolerance. Degenerate triangles are kept: lib/surface finds them.
/// @param unit_mm  size in mm of the file's unit where it says none. A unit in a comment or header wins (PLY, OBJ, STL,
/// OFF: take_frame()); a GLB is in metres unless this says otherwise; without either, coordinates are mm
/// @param require_unit  without unit_mm, OBJ, STL and OFF that say none are a UsageError that tells to pass --mesh-unit
/// Errors: InputError naming the file: missing, truncated, bad index, not finite, no triangles, over the limits.
/// Cost: linear; 1 million triangles: 0.1 s (binary PLY).
/// Limits: 2^31 - 1 vertices and triangles, coordinates within 1e12 mm.
MeshFile read_mesh(const std::filesystem::path& path, std::optional<double> unit_mm = {}, bool require_unit = false);

/// For a unit that is meant for this file alone. Errors: InputError when the file's own `units` say another one.
void require_no_other_unit(const MeshFile& file, std::optional<double> unit_mm, const std::filesystem::path& path);

/// A note where a unit is assumed, or the file's own holds in place of the one that read_mesh() was given.
std::optional<Warning> unit_note(const MeshFile& file, const std::filesystem::path& path,
                                 std::optional<double> unit_mm);

/// The curved shell mesh in a file: positions, unit normals, patch. Errors: InputError when it has no normals.
ShellMesh shell_of(const MeshFile& file, const std::filesystem::path& path);

/// The world axes two meshes share: what either of them says, "LPS" where neither does.
/// Errors: InputError when both say and differ: every distance between them would be wrong.
std::string common_space(const MeshFile& a, const std::filesystem::path& path_a, const MeshFile& b,
                         const std::filesystem::path& path_b);

/// The same of what they say.
std::string common_space(const std::optional<std::string>& a, const std::filesystem::path& path_a,
                         const std::optional<std::string>& b, const std::filesystem::path& path_b);

struct PlyOptions {
  std::vector<std::string> comments = {};  ///< further comments (provenance), one line each
  std::string space = "LPS";
  bool millimetres = true;  ///< say `units mm`; false where the unit of the numbers is not known
  bool overwrite = false;
  bool partial = false;  ///< leave it as NAME.part: the best mesh of a run that failed its requirement
};

/// Binary little-endian PLY, double x y z, int indices. Errors: OutputError.
void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyOptions& options);
void write_ply(const std::filesystem::path& path, const ShellMesh& shell, const PlyOptions& options);
/// With a per-vertex `thickness` (double, mm); none where that is empty.
void write_ply(const std::filesystem::path& path, const ShellMesh& shell, const std::vector<double>& thickness,
               const PlyOptions& options);
/// With a per-vertex `quality` (double).
void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const std::vector<double>& quality,
               const PlyOptions& options);

}  // namespace tunica
