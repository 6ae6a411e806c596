#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

namespace tunica {

/// Whether components, boundary loops and handles are as many; loops of the target that are a point may be closed.
bool same_topology(const TriangleMesh& mesh, const Target& target);

/// A quadric decimation of the target with so many triangles.
TriangleMesh decimation(const Target& target, std::size_t triangles);

/// One whose flat facets are about `error` (mm, sampled) from the target: flat errors go with 1 / triangles.
TriangleMesh decimation_within(const Target& target, double error);

/// A mesh on the target as shells: the target's normals at its nodes, one for each side along its creases.
///
/// A crease is a curve of connected edges of the target that turn by more than 60 degrees, 15 % of the diagonal long
/// or more.
/// @param patch  of the shells
ShellMesh shells_on(const Target& target, const TriangleMesh& mesh, Patch patch);

/// The same shells with a normal for each side of what folds, facet by facet if need be, at nodes where no one normal
/// makes shells of all that meet there.
ShellMesh creased_where_folded(ShellMesh shell);

}  // namespace tunica
