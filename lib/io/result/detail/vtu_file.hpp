#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <variant>
#include <vector>

/// VTK's XML file of an unstructured grid. Inside lib/io.
namespace tunica {

/// Values as they stand in memory; they must outlive the writing.
struct VtuArray {
  std::string name;
  std::size_t components = 1;
  std::variant<std::span<const float>, std::span<const double>, std::span<const std::int32_t>,
               std::span<const std::uint8_t>>
      values;
};

/// An unstructured grid.
struct VtuGrid {
  std::span<const double> coordinates;         ///< 3 per point
  std::span<const std::int32_t> connectivity;  ///< points of the cells, one after the other
  std::span<const std::int32_t> ends;          ///< where each cell's points end
  std::span<const std::uint8_t> types;         ///< VTK's numbers
  std::vector<VtuArray> of_points, of_cells, of_grid;
};

/// Writes a whole file: arrays compressed by zlib, appended in base64, so that any XML reader reads it.
/// Source: VTK file formats, "XML file formats" (version 1.0, header_type UInt64, vtkZLibDataCompressor).
/// @param made_by  provenance, a comment of the file
/// Errors: OutputError.
void write_vtu(const std::filesystem::path& path, const VtuGrid& grid, const std::string& made_by, bool overwrite);

}  // namespace tunica
