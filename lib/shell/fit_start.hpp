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

/// Whether most of the area of a plain decimation is in needles: as along a cylinder, where length costs no error.
bool is_of_needles(const TriangleMesh& mesh);

/// Whether pieces, boundary loops and handles are as many; loops of the target that are a point may be closed.
bool same_topology(const TriangleMesh& mesh, const Target& target);

/// COARSE itself, for a fit that keeps its triangles.
FitStart start_as_given(const TriangleMesh& coarse, const Target& target);

/// A decimation of the target with so many triangles.
FitStart start_of_fit(const Target& target, std::size_t triangles);

/// The decimation with about the distance `flat_error` (mm), or where that has fewer than `few` triangles the one with
/// about `finer_error`.
FitStart start_of_fit(const Target& target, double flat_error, std::size_t few, double finer_error);

/// A decimation of a dense target with at most a quarter of its triangles and about the distance `flat_error` (mm):
/// what is closest is found much sooner there. None where the target has fewer than 80,000 or its facets matter so
/// much.
std::optional<FitStart> stand_in_for(const Target& target, double flat_error);

/// The start as a mesh under edit, with the target's normals at its nodes: several at a node where sharp creases of the
/// target meet there. A crease is an edge whose sides, close by, turn by nearly as much as its facets do.
FitMesh prepare_fit(const FitStart& start, const Target& target);

}  // namespace tunica
