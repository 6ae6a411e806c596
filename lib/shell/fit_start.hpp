#pragma once

#include "shell/fit_mesh.hpp"
#include "shell/target.hpp"

#include <optional>

namespace tunica {

/// A mesh to start the fit from.
struct FitStart {
  TriangleMesh mesh;
  double flat_error = 0;      ///< mm, sampled: of its flat facets
  bool own_topology = false;  ///< it is COARSE, because its topology is not the target's
};

/// @param flat_error  mm: a decimation of the target with about this distance; or
/// @param triangles   with this many triangles, when given
FitStart start_of_fit(const TriangleMesh& coarse, const Target& target, std::optional<std::size_t> triangles,
                      double flat_error);

/// The start as a mesh under edit, with the target's normals at its nodes: several at a node where sharp creases of the
/// target meet there. A crease is an edge whose sides, close by, turn by nearly as much as its facets do.
FitMesh prepare_fit(const FitStart& start, const Target& target);

}  // namespace tunica
