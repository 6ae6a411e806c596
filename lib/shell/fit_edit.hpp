#pragma once

#include "core/progress.hpp"
#include "shell/fit_state.hpp"

namespace tunica {

/// Merges nodes along edges, cheapest first by the error that the merged and newly placed node's patches have, as long
/// as this is at most `limit` (mm) and more than `shells` triangles are left. Keeps topology (link condition), boundary
/// loops and the soundness of facets. @return how many nodes vanished
/// Cost: about 0.3 ms per edge tried, some five per merger.
std::size_t collapse_edges(FitState& state, double limit, std::size_t shells, const Progress& progress);

/// Merges two nodes of an edge where topology allows it and the patches around come within `limit` (mm). @return
/// whether they did
bool merge_edge(FitState& state, Index u, Index v, double limit);

/// Turns edges where that lessens the larger error of the two patches, or mends angles below the limit without an
/// error above `limit` (mm) and above those before. @return how many
std::size_t flip_edges(FitState& state, double limit);

/// Cuts an edge by a node of its own, placed where the patches come closest. @return whether that was possible
bool split_edge(FitState& state, Index u, Index v, double limit);

/// Places a node anew, from `start`, with no angle around it below `angle` (degrees; 0: as they are), and keeps that
/// when the largest error around is then below `limit` (mm). @return whether it did
bool move_node(FitState& state, Index node, const Vec3& start, double angle, double limit);

/// Takes back normals of their own: where several meet at a node they become one, or fewer, as long as the largest
/// error around stays below `limit` (mm). @return how many went
std::size_t join_normals(FitState& state, double limit);

}  // namespace tunica
