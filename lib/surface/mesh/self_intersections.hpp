#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Whether two triangles touch or cross. Exact: nothing is missed or invented by rounding; no area, no crossing.
/// Cost: 10 ns where the plane of one lies clear of the other, a microsecond else.
bool triangles_cross(const std::array<Vec3, 3>& one, const std::array<Vec3, 3>& other);

/// The same for triangles whose first corners are the same point: whether they meet anywhere else.
bool triangles_cross_beside_corner(const std::array<Vec3, 3>& one, const std::array<Vec3, 3>& other);

/// The pairs of boxes that touch or overlap, in ascending order, the smaller number first. Errors: Interrupted.
std::vector<std::array<Index, 2>> overlapping_boxes(const std::vector<Vec3>& lower, const std::vector<Vec3>& upper);

/// The pairs of triangles that share no vertex (by index) and touch or cross. Exact predicates: no pair is missed or
/// invented by rounding. Triangles without area are left out.
/// @param patch          empty, or #F: the patch (curved shell) that each triangle is a part of; then pairs of patches
///                       are found, once each
/// @param patch_corners  with `patch`: the corners of each patch; patches that share a corner are not a pair
/// @return pairs in ascending order, the smaller number first
/// Errors: Interrupted.
/// Cost: n log n, about a second for half a million triangles.
std::vector<std::array<Index, 2>> find_self_intersections(const TriangleMesh& mesh,
                                                          const std::vector<Index>& patch = {},
                                                          const std::vector<std::array<Index, 3>>& patch_corners = {});

/// How many they are.
std::size_t count_self_intersections(const TriangleMesh& mesh, const std::vector<Index>& patch = {},
                                     const std::vector<std::array<Index, 3>>& patch_corners = {});

}  // namespace tunica
