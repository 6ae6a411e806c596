#pragma once

#include "surface/triangle_mesh.hpp"

namespace tunica {

/// The same surface in smaller triangles, for values that vary inside a large one: each triangle is cut into k^2 alike,
/// k as small as its longest edge / `longest_edge` (mm) allows. The given vertices come first, in their order.
/// Limits: vertices on the edges are not shared between the triangles. At most `most_triangles` come out: the edges are
/// longer where that would not do.
TriangleMesh subdivided(const TriangleMesh& mesh, double longest_edge, std::size_t most_triangles = 4'000'000);

}  // namespace tunica
