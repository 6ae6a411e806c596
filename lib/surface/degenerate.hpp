#pragma once

#include "surface/triangle_mesh.hpp"

namespace tunica {

/// Whether a triangle has no area to speak of: its height over the longest edge is below 1e-9 of that edge.
bool is_degenerate(const Vec3& a, const Vec3& b, const Vec3& c);

/// How many triangles is_degenerate() finds. Cost: linear.
std::size_t count_degenerate(const TriangleMesh& mesh);

struct WithoutDegenerate {
  TriangleMesh mesh;
  double moved = 0;  ///< mm: how far the new surface is at most from the given one
};

/// Takes out degenerate triangles where the surface stays what it is: needles by collapsing the edge between vertices
/// that coincide, caps by flipping the edge that the third vertex lies on, or else by collapsing an edge shorter than
/// 1e-6 of the longest; a cap at a boundary goes, and the vertex becomes one of the boundary. Unused vertices are
/// dropped.
/// @param mesh  an oriented manifold
/// Keeps: Euler number, pieces, boundary curves. Deterministic.
/// Cost: linear but for pockets of degenerate triangles. Limits: one stays where a collapse or flip would change the
/// topology (two edges between the same vertices), and where it is a spike of the boundary.
WithoutDegenerate without_degenerate_triangles(const TriangleMesh& mesh);

}  // namespace tunica
