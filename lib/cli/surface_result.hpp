#pragma once

#include "tunica/core/json.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

/// What reports say of extracted surfaces.
namespace tunica::cli {

/// Every key of `result`, null.
Json undefined_surface();

/// Measures a surface. Errors: InternalError: it is not what marching cubes promises.
/// @param outward  its normals point from inside to outside; open_border  it may have a boundary
/// @return all keys but `voxel_volume_mm3`
Json measure_surface(const TriangleMesh& mesh, bool outward, bool open_border);

/// Sums of what can be summed, over the surfaces of several labels; the report's top level.
Json sum_of_surfaces(const Json& surfaces);

}  // namespace tunica::cli
