// surface/filling: tetrahedra inside a closed surface.
#pragma once

#include "tunica/surface/mesh/tet_mesh.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Fills a closed surface with tetrahedra whose edges are `size` mm long on average. Its boundary lies within size / 10
/// of the surface and is finer where that needs shorter edges. Edges at which the surface bends by more than 60 degrees
/// are kept as edges of the mesh. Which way the surface faces does not matter; a surface within another one is a
/// cavity.
/// @param size  mm
/// @return a mesh for which require_sound() holds. Its smallest_dihedral() is mostly 8 degrees or more: below that
///   further optimisation is tried, and the best mesh found is returned. The same input gives the same mesh, bit by
///   bit.
/// Errors: InputError when the surface is open, crosses itself or is no oriented manifold, or when `size` is not
/// positive or so small that more than 20 million tetrahedra would come out; RequirementError when no mesh is found, or
/// one that lacks parts of the surface or a tenth of its volume: a smaller size may do; Interrupted, while the mesh is
/// refined and between the optimisations.
/// Cost: about 0.1 ms a tetrahedron.
/// Limits: sharp edges that meet at less than some 10 degrees, and the steps of voxels (nothing but sharp edges), make
/// tetrahedra much smaller than `size` and of bad shape: smooth such a surface before. Walls thinner than `size` get
/// smaller tetrahedra only where the curvature asks for them.
TetMesh fill(const TriangleMesh& closed_surface, double size);

}  // namespace tunica
