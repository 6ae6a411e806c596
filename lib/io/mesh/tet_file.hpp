#pragma once

#include "tunica/surface/mesh/tet_mesh.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tunica {

/// A file of tetrahedra as read, positions in mm.
struct TetFile {
  TetMesh mesh;
  std::vector<std::string>
      notes;  ///< what was passed over or changed, a sentence each that begins with the file's name
};

/// Reads linear tetrahedra from Gmsh (.msh of the versions 2 and 4.1, ASCII and binary), VTK's legacy format (.vtk,
/// ASCII and binary, both layouts of the cells) and its XML format (.vtu: ASCII, base64 or raw, plain or zlib). The
/// format is known by content, then by extension. Points, lines and faces are passed over, vertices that no tetrahedron
/// uses are left out, tetrahedra that are inside out are turned, each with a note. All regions of a file are one mesh.
/// @param unit_mm  size in mm of the file's unit, which none of these formats says
/// @param scale    positions are multiplied by it, too
/// @return a mesh for which require_sound() holds
/// Errors: InputError naming the file: no unit, missing, truncated, counts that its size belies, bad index, not finite,
/// no tetrahedra, tetrahedra that are quadratic or have no volume, other volume elements.
/// Cost: linear, n log n for numbers of vertices without order (.msh).
/// Limits: pieces of a .vtu are not joined, which a note says; 2^31 - 1 vertices and tetrahedra, coordinates within
/// 1e12 mm; binary .msh must be little-endian; of a .vtk, field data before the mesh must be numbers.
TetFile read_tetrahedra(const std::filesystem::path& path, std::optional<double> unit_mm, double scale);

}  // namespace tunica
