#pragma once

#include "tunica/io/result/page_file.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <string>
#include <vector>

namespace tunica::report {

/// The shells of a case as they are drawn in 3-D.
struct DrawnShells : DrawnResult {
  std::vector<std::array<Index, 2>> edges;  ///< of the shells, in pieces; empty where they are too many
  std::vector<double> distance;             ///< #V, mm, to the segmented surface; empty: not known
};

/// What the states are called.
std::vector<std::string> labels_of(const DrawnResult& result);

/// What a result draws, with at most `triangles` of the shells, and as many of the solids: fewer pieces per shell
/// first, and where the shells alone are too many, decimated. Errors: InputError where the surface cannot be decimated.
DrawnShells thinned(DrawnResult result, std::size_t triangles);

/// The same surface with at most so many triangles. Errors: InputError as decimate().
TriangleMesh thinned(const TriangleMesh& mesh, std::size_t triangles);

}  // namespace tunica::report
