#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Whether a triangle has no area to speak of: its height over the longest edge is below 1e-9 of that edge.
bool is_degenerate(const Vec3& a, const Vec3& b, const Vec3& c);

/// How many triangles is_degenerate() finds. Cost: linear.
std::size_t count_degenerate(const TriangleMesh& mesh);

struct WithoutDegenerate {
  TriangleMesh mesh;
  double moved = 0;              ///< mm: how far the new surface is at most from the given one
  std::size_t closed_loops = 0;  ///< boundary loops that were a point
  double longest_spike = 0;      ///< mm, of those taken away
  std::size_t long_spikes = 0;   ///< those that stayed for their length
};

/// Takes out degenerate triangles where the surface stays what it is: needles by collapsing the edge between vertices
/// that coincide, caps by flipping the edge that the third vertex lies on, or else by collapsing an edge shorter than
/// 1e-6 of the longest; a cap at a boundary goes, and the vertex becomes one of the boundary. A boundary loop without
/// extent (below 1e-9 of the longest edge there) is closed: its vertices become one. Spikes, degenerate triangles that
/// hang on the rest by one edge, go; their length is the distance of their farthest point from that edge. Unused
/// vertices are dropped.
/// @param mesh  an oriented manifold
/// @param longest_spike  mm: with all else that moves the surface, spikes may take no more; longer ones stay
/// Keeps: Euler number (closed loops are one more each), pieces, boundary curves. Deterministic.
/// Cost: linear but for pockets of degenerate triangles. Limits: one stays where a collapse or flip would change the
/// topology (two edges between the same vertices, a neck without width), and a piece without area stays whole.
WithoutDegenerate without_degenerate_triangles(const TriangleMesh& mesh, double longest_spike = infinity);

}  // namespace tunica
