#pragma once

#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/distance/target.hpp"

namespace tunica {

/// The bodies of a level, and of the level before what their further nodes halve.
struct Level {
  std::vector<ShellBody> bodies;
  std::vector<std::vector<std::array<Index, 2>>> parents;  ///< of each body: two of its nodes for each new one

  [[nodiscard]] std::size_t shell_count() const;
};

/// Every shell split in four, the nodes of each body first; a thickness per vertex is interpolated. Fitted to its
/// target where a body has one (not null).
Level finer_level(const std::vector<ShellBody>& bodies, const std::vector<const Target*>& targets);

/// A state of the coarser level at the finer one's nodes: along each edge the cubic that the ends' displacements and
/// rotations say, so that rigid motions stay what they are.
Checkpoint interpolated(const State& state, const std::vector<ShellBody>& coarse, const Level& fine);

/// Nodes and edges that supports and loads of the coarser model select stay selected, and with two of them the one
/// between: a refit moves rims out of the planes in which a scene finds them. Not across a corner, where all of a shell
/// is selected but for the rim: there the place decides, as it does for a single node, for regions of pressures and
/// beds, and for edges that a region cuts.
/// @param fine  the model that its own places make; its nodes are added to
void carry_selections(const Model& coarse, const Level& level, Model& fine);

/// Largest difference of the displacements at the coarser level's nodes, of the finer's largest.
double field_change(const State& coarse, const State& fine, const Level& level);

/// The width of the bending layer over the longest edge there, at worst, of shells at supports, rims, point and edge
/// loads and jumps of the thickness; infinite: there are none. Source: of the edge effect of a cylinder the decay
/// length, sqrt(R t) / (3 (1 - nu^2))^(1/4), 1.24 for nu = 0.45.
double edges_per_layer(const Model& model);

}  // namespace tunica
