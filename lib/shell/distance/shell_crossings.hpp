#pragma once

#include "tunica/shell/patch/shell_mesh.hpp"

namespace tunica {

/// Whether two shells of a pair have a corner in common. Limits: numbers of shells that are there.
bool share_a_node(const ShellMesh& shell, const std::array<Index, 2>& pair);

/// The pairs of shells whose curved surfaces touch or cross: anywhere, where they share no node; beside the node, where
/// they share one; where they share two, further from their edge than an eighth of their heights: patches of the comas
/// kind gape and overlap a little along each edge, which is gap and no crossing, while patches that fold over reach
/// past that. Patches on the same three nodes are no pair.
///
/// Certain but for the drawing: each patch is cut where it comes near another until its pieces are flat to within
/// 1e-4 of its longest edge, and these meet or not by exact predicates. What crosses less deeply may be missed, and
/// what lies closer without crossing may be counted.
/// @param shell  as require_fit() wants it
/// @param neighbours  whether pairs that share a node count: bent far they take long
/// @return pairs in ascending order, the smaller number first
/// Errors: Interrupted. Cost: n log n, about 5 microseconds per shell, and a millisecond for each pair that meets, at
/// most some ten for one that is bent far, which counts as one that meets.
std::vector<std::array<Index, 2>> crossing_patches(const ShellMesh& shell, bool neighbours = true);

}  // namespace tunica
