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
};

/// What a result draws, with at most `triangles`: fewer pieces per shell first, and where the shells alone are too
/// many, decimated.
/// Errors: InputError where the surface cannot be decimated.
DrawnShells thinned(DrawnResult result, std::size_t triangles);

/// The same surface with at most so many triangles. Errors: InputError as decimate().
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t triangles);

}  // namespace tunica::report
