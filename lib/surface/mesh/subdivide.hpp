#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <functional>
#include <vector>

namespace tunica {

/// The same surface in smaller triangles, for values that vary inside a large one: each triangle is cut into k^2 alike,
/// k as small as its longest edge / `longest_edge` (mm, finite, > 0: else InputError) allows. The given vertices come
/// first, in their order. Limits: vertices on the edges are not shared between the triangles. At most `most_triangles`
/// come out: the edges are longer where that would not do.
TriangleMesh subdivided(const TriangleMesh& mesh, double longest_edge, std::size_t most_triangles = 4'000'000);

/// Into how many parts the edges of each triangle are cut to place points within it: what `parts` says of its longest
/// edge (mm), rounded down. All get fewer alike where that would be more than `most` points: needles are long, and
/// hardly any surface. Cost: linear.
std::vector<int> parts_for_points(const TriangleMesh& mesh, const std::function<double(double)>& parts, double most);

}  // namespace tunica
