// io/result: result files, what pages show of them, reports, journals of runs, models for other programs.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace tunica {

/// The shells and solids of a result as a page draws them: each shell cut into pieces² triangles whose points
/// neighbours share, of solids the outer faces.
struct DrawnResult {
  struct State {
    std::size_t number = 0;  ///< among the written ones; 0 is the reference
    double time = 0;         ///< s; of a mode its frequency, Hz, or its factor; else as the load factor
    double load_factor = 0;
    std::vector<Vec3> displacement;  ///< #V, mm
    std::vector<double> membrane;    ///< #V, MPa, von Mises stress of the mean over the wall
    std::vector<double> von_mises;   ///< #V, MPa, the larger of both faces
    std::vector<Vec3> of_solids;     ///< displacement, mm, of each vertex of `solids`
  };
  /// In the order of RunSettings::kind.
  enum class Kind { statics, motion, frequencies, buckling, path };

  TriangleMesh reference;  ///< mm; the triangles of a shell are consecutive
  std::size_t shells = 0;
  std::size_t pieces = 1;     ///< per edge of a shell
  TriangleMesh solids;        ///< mm; no triangles where there are none
  std::vector<State> states;  ///< at least one; of many so many evenly chosen, the first and the last among them
  Kind kind = Kind::statics;
  bool is_unloaded = false;  ///< the reference is not what was imaged, but the shape without the pressure of then
  std::string made_by{};     ///< program and command, for who looks into the file; not read
};

/// What a page shows of one case at the most: triangles of the shells, states, and what moves in them, bytes as a page
/// packs them, 8 per point.
inline constexpr std::size_t most_page_triangles = 60'000, most_page_states = 41, most_page_bytes = 12'000'000;

/// States that are kept of `there`, evenly chosen, the first and the last among them. @param most  at least 2
std::vector<DrawnResult::State> evenly_chosen(std::vector<DrawnResult::State> states, std::size_t most);

/// OUT.page beside OUT.hdf.
std::filesystem::path page_path(const std::filesystem::path& result);

/// A line of JSON, which names and counts what follows: as float and uint32, little-endian, the points, mm, and the
/// triangles of the shells, those of the solids, and of each state displacement, membrane stress and stress at the
/// faces of the shells' points, displacement of the solids'. docs/results.md has the layout. Errors: OutputError.
void write_page_file(const std::filesystem::path& path, const DrawnResult& drawn, bool overwrite);

/// Errors: InputError naming the file: missing, of another kind, damaged, without shells. Cost: the file's bytes, three
/// times as much memory.
DrawnResult read_page_file(const std::filesystem::path& path);

}  // namespace tunica
