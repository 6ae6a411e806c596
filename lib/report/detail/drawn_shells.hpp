#pragma once

#include "tunica/io/result/drawn_result.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <string>
#include <vector>

namespace tunica::report {

/// The shells of a case as they are drawn in 3-D.
struct DrawnShells {
  TriangleMesh mesh;                        ///< as imaged, mm
  std::vector<std::array<Index, 2>> edges;  ///< of the shells, in pieces; empty where they are too many
  std::vector<DrawnResult::State> states;   ///< at least one
  std::vector<std::string> labels;          ///< of the states
  std::vector<double> distance;             ///< #V, mm, to the segmented surface; empty: not known
  TriangleMesh solids;                      ///< outer faces; no triangles where there are none
  bool is_unloaded = false;                 ///< `mesh` is not what was imaged, but the shape without its load
};

/// What a result draws, with at most `triangles` of the shells, and as many of the solids: fewer pieces per shell
/// first, and where the shells alone are too many, decimated. Errors: InputError where the surface cannot be decimated.
DrawnShells thinned(DrawnResult result, std::size_t triangles);

/// The same with at most so many states, evenly chosen, the first and the last among them. @param most  at least 2
DrawnShells with_fewer_states(DrawnShells shells, std::size_t most);

/// The same surface with at most so many triangles. Errors: InputError as decimate().
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t triangles);

}  // namespace tunica::report
