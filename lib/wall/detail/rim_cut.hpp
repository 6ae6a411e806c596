#pragma once

#include "tunica/wall/detail/level_set.hpp"

namespace tunica {

/// Ends a level of a face with rims where the face ends: in a flat rim's plane, else half of the wall beside the rim.
/// What lies beyond is cut away, and what marching cubes made where there is no level.
/// @param cell  of the grid that made the mesh
TriangleMesh cut_at_rims(const TriangleMesh& mesh, const HalfWayLevel& level, double cell);

}  // namespace tunica
