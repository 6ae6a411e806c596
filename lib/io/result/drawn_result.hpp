// io/result: result files, reports, journals of runs, and what is drawn from reports.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace tunica {

/// The shells of a result file as they are drawn: each cut into level² triangles whose points neighbours share.
struct DrawnResult {
  struct State {
    double time = 0;                 ///< s; in a static result the load factor
    std::vector<Vec3> displacement;  ///< #V, mm
    std::vector<double> von_mises;   ///< #V, MPa
  };
  TriangleMesh reference;  ///< mm; the triangles of a shell are consecutive
  std::size_t shells = 0;
  std::vector<State> states;  ///< the written ones, evenly chosen; of a static result the reference and the last
  bool timed = false;         ///< the states' times are seconds
  std::string scene;          ///< resolved, SI, TOML; empty where the file does not say
};

/// Reads what tunica-simulate drew. Solids' tetrahedra are left out.
/// @param most_states  at most this many states, the first and the last among them; at least 2
/// Errors: InputError naming the file: missing, not a result of tunica, damaged, inconsistent.
/// Cost: memory for the states that are read. Limits: 2^31 - 1 points; a static result of many load steps gives the
/// last state alone.
DrawnResult read_drawn_result(const std::filesystem::path& path, std::size_t most_states);

}  // namespace tunica
