#pragma once

#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/distance/target.hpp"

namespace tunica {

/// Every shell split in four, the nodes of `body` first; a thickness per vertex is interpolated. Fitted to the target
/// where there is one.
/// @param parents  gets the two nodes whose edge each further node halves
ShellBody finer_level(const ShellBody& body, const Target* target, std::vector<std::array<Index, 2>>& parents);

/// A state of the coarser level at the finer one's nodes: along each edge the cubic that the ends' displacements and
/// rotations say, so that rigid motions stay what they are.
Checkpoint interpolated(const State& state, const ShellBody& coarse, const ShellBody& fine,
                   const std::vector<std::array<Index, 2>>& parents);

/// Largest difference of the displacements at the coarser level's nodes, of the finer's largest.
double field_change(const State& coarse, const State& fine);

/// The width of the bending layer over the longest edge there, at worst, of shells at supports and rims; infinite:
/// there are none. Source: of the edge effect of a cylinder the decay length, sqrt(R t) / (3 (1 - nu^2))^(1/4), 1.24
/// for nu = 0.45.
double edges_per_layer(const Model& model);

}  // namespace tunica
