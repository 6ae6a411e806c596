#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// The part of a surface with normal.x <= offset, cut open along that plane: rims lie in it, to the last digit but one.
/// Vertices within a quarter of an edge from the plane are moved along that edge into it, so that no sliver is left;
/// other triangles are cut in two. What only touches the plane is gone; where parts meet at a point of it, each has a
/// vertex of its own. Vertices that are left over are dropped; the order of the others and of the triangles stays.
/// @param normal  unit
/// @return empty where nothing is on that side. A rim that was there before is cut like the rest.
/// Errors: InputError as require_valid() of the surface; a normal or an offset that is not one.
/// Cost: linear.
TriangleMesh cut_open(const TriangleMesh& surface, const Vec3& normal, double offset);

}  // namespace tunica
