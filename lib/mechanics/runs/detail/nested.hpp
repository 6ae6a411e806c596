#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstddef>

namespace tunica {

/// The triangles of closed pieces of a surface that lie inside another closed piece and face the other way: what is
/// left of a cavity, whose normals point towards its hollow. Zero where there are none.
/// Cost: linear; where closed pieces face both ways, a search tree for each that others may lie in.
std::size_t triangles_of_cavities(const TriangleMesh& surface);

}  // namespace tunica
