#pragma once

#include "shell/shell_mesh.hpp"

#include <optional>
#include <span>
#include <vector>

namespace tunica {

/// The pieces of a mesh that hang together through edges, in the order of their first triangles; unused vertices are
/// dropped. Cost: linear.
/// @param across  neighbours()
std::vector<TriangleMesh> parts_of(const TriangleMesh& mesh, std::span<const std::array<Index, 3>> across);

/// Several meshes as one, triangles and vertices in their order.
TriangleMesh joined(std::span<const TriangleMesh> parts);

/// The same of shell meshes with the same patch; with normals per corner where any of them has.
ShellMesh joined(std::span<const ShellMesh> parts);

/// The facets of a mesh as shells that are flat: the normals at their corners are their own.
ShellMesh flat_shells(const TriangleMesh& mesh, Patch patch);

/// The flat triangles that hold a tolerance (mm) to a crumb: a piece of a few tolerances' size, and with so few of them
/// that patches have no room. Those with all angles at least `angle` (degrees) where they are no more than twice as
/// many. Of a larger piece: nothing. Errors: as decimate(). Cost: linear; for crumbs two decimations.
std::optional<TriangleMesh> crumb_within(const TriangleMesh& part, double tolerance, double angle);

}  // namespace tunica
