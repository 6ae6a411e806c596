#pragma once

#include "tunica/io/mesh/mesh_file.hpp"

#include <array>
#include <filesystem>
#include <string>
#include <vector>

/// Triangle surfaces for other programs. PLY is the pipeline's own format and keeps every bit; the others are for
/// looking, printing and animating.
namespace tunica {

/// The endings that write_surface() understands: .ply .glb .obj .stl .3mf
const std::vector<std::string>& surface_endings();

/// How a surface is to look; either may be empty.
struct SurfaceLook {
  std::vector<Vec3> normals;                   ///< #V, unit
  std::vector<std::array<double, 3>> colours;  ///< #V, red, green, blue in sRGB, 0 to 1; only GLB and OBJ keep them
};

/// Writes a surface in the format of the path's ending. PLY: write_ply(). GLB, OBJ, binary STL and 3MF: assimp's
/// exporters. Errors: OutputError.
/// Limits: those hold floats: 7 digits of a coordinate, OBJ and 3MF 6. STL shares no vertices; it and OBJ say their
/// unit, mm, in header and comment; GLB is in metres, by the scale of its node. None of them holds shells: normals are
/// for shading. Files of assimp depend on its version to the byte.
void write_surface(const std::filesystem::path& path, const TriangleMesh& mesh, const PlyOptions& options,
                   const SurfaceLook& look = {});

}  // namespace tunica
