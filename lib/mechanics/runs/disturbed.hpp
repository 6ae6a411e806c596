#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <cstdint>
#include <vector>

/// Where something other than the shape of a wall decides its stress.
namespace tunica {

/// Nodes of a body at which its wall bends over a short length: those that are held or bear point loads, rims, where
/// edge loads act as well, and jumps of the thickness by a quarter within a shell. Errors: InputError: as
/// require_valid(), no such body. Cost: linear.
std::vector<std::uint8_t> disturbed_nodes(const Model& model, std::size_t body);

/// Shells of all bodies in order (0 or 1) whose middle is within two bending lengths sqrt(R t) of such nodes, along the
/// edges: there a layer of e^(-2 x 1.24) of its height is left. R is the smaller radius of curvature in the mean over
/// the shells around the nodes that hang together, as a rim does, t the thickness there; flat shells have no layer.
/// Errors: InputError as require_valid(). Cost: n log n.
std::vector<std::uint8_t> near_disturbances(const Model& model);

}  // namespace tunica
