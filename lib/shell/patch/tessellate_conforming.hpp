#pragma once

#include "tunica/shell/patch/curved_surface.hpp"

namespace tunica {

/// A fine triangle mesh of the curved surface, as tessellate() makes one, whose triangles also meet where neighbouring
/// patches are cut into pieces of different size: an edge is cut as finely as the finer of its patches, and the strip
/// along it goes from these pieces to those of the patch. Patches share the vertices on their edges, so that a closed
/// shell mesh becomes a closed mesh.
/// @param deviation  mm, > 0: of the curved surface and the mesh at equal parameters, certified
/// Errors: RequirementError when this would take more than `most_triangles`; InputError as tessellate(), and where the
/// patches are not watertight.
/// Source: strips as in the tessellation stage of graphics processors (OpenGL 4.6, 11.2.2.1). Cost: as tessellate().
TriangleMesh tessellate_conforming(const ShellMesh& shell, double deviation, std::size_t most_triangles = 100'000'000);

}  // namespace tunica
