#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/labels/mask.hpp"

namespace tunica {

/// Whether the normals of every component of a marching-cubes surface point from inside to outside its selection.
/// Each vertex lies on an edge of the voxel grid, or on a voxel's centre: its normal is compared with the step from
/// inside to outside there, and the sum over a component has to be positive.
/// @param mesh  as marching_cubes() made it, not smoothed
/// @param open_border  as given to marching_cubes()
/// Errors: InputError as require_valid() of the mesh.
/// Cost: linear in the size of the mesh.
bool faces_outward(const TriangleMesh& mesh, const Mask& mask, bool open_border);

}  // namespace tunica
