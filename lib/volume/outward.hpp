#pragma once

#include "surface/triangle_mesh.hpp"
#include "volume/mask.hpp"

namespace tunica {

/// Whether every component of a surface has its normals from inside to outside the selection it came from: of the
/// points half a voxel behind and before its triangles, weighted by area, more lie inside behind than before.
/// Cost: linear in the triangles.
/// Limits: a vote, not a proof: of a component thinner than half a voxel everywhere it says nothing (and so: not
/// outward).
bool faces_outward(const TriangleMesh& mesh, const Mask& mask);

}  // namespace tunica
