#pragma once

#include "tunica/volume/labels/mask.hpp"

#include <vector>

namespace tunica {

/// Pieces are 6-connected (voxels that share a face) and cavities are 18-connected components of the background (that
/// share a face or an edge) which do not reach the image's border. It is the rule by which marching_cubes() cuts: a
/// closed surface has exactly one component for each piece and one for each cavity.

/// Sizes in voxels of the pieces, largest first.
std::vector<std::size_t> piece_sizes(const Mask& mask);

/// Drops all pieces but the one with the most voxels (of equals the first in memory). @return how many were dropped
std::size_t keep_largest_piece(Mask& mask);

/// Turns the voxels of all cavities to inside. @return how many cavities there were
std::size_t fill_cavities(Mask& mask);

// Source: union-find over runs of voxels (He, Chao, Suzuki 2008). Cost: one pass over the bits, 16 bytes per run.

}  // namespace tunica
