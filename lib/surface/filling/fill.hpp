// surface/filling: tetrahedra inside a closed surface.
#pragma once

#include "tunica/surface/mesh/tet_mesh.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Fills a closed surface with tetrahedra whose edges are `size` mm long on average. Its boundary
/// lies within about size / 10 of the surface, with shorter edges where that needs them. Edges at which the surface
/// bends by more than 60 degrees are kept as edges of the mesh. Which way the surface faces does not matter; a surface
/// within another one is a cavity.
/// @param size  mm
/// @return a mesh for which require_sound() holds. Its smallest_dihedral() is mostly 8 degrees or more: below that
///   further optimisation is tried, and the best mesh found is returned. The same input gives the same mesh, bit by
///   bit.
/// Errors: InputError when the surface is open, crosses itself or is no oriented manifold, or when `size` is not
/// positive or so small that more than 20 million tetrahedra would come out; RequirementError when no mesh is found, or
/// one that lacks parts of the surface or a tenth of its volume: a smaller size may do; Interrupted, while the mesh is
/// refined and between the optimisations.
/// Cost: about 10 us a tetrahedron without sharp edges, up to 0.3 ms where most lie at one.
/// Limits: sharp edges that lie closer together than `size`, or meet at a small angle, make smaller tetrahedra there,
/// and of bad shape if the angle is; so do the steps of voxels, which are nothing but sharp edges: smooth such a
/// surface before. A smooth wall thinner than `size` gets tetrahedra as flat as the criteria of the boundary allow.
TetMesh fill(const TriangleMesh& closed_surface, double size);

}  // namespace tunica
