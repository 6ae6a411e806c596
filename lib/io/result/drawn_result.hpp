// io/result: result files, reports, journals of runs, and what is drawn from reports.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace tunica {

/// The shells and solids of a result file as they are drawn: each shell cut into level² triangles whose points
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
  enum class Kind { statics, path, motion, frequencies, buckling };

  TriangleMesh reference;  ///< mm; the triangles of a shell are consecutive
  std::size_t shells = 0;
  TriangleMesh solids;        ///< mm; no triangles where there are none
  std::vector<State> states;  ///< the written ones, evenly chosen
  Kind kind = Kind::statics;
  bool is_unloaded = false;  ///< the reference is not what was imaged, but the shape without the pressure of then
  std::string scene;         ///< resolved, SI, TOML; empty where the file does not say
};

/// Reads what tunica-simulate drew. Of a static run, which draws its last state alone, the others come from the nodes,
/// by the same curved displacements and recovered stresses.
/// @param most_states  at most this many states, the first and the last among them; at least 2
/// Errors: InputError naming the file: missing, not a result of tunica, damaged, inconsistent.
/// Cost: memory for the states that are read. Limits: 2^31 - 1 points; all shells of a static run are drawn by the kind
/// of patch of the first one.
DrawnResult read_drawn_result(const std::filesystem::path& path, std::size_t most_states);

}  // namespace tunica
