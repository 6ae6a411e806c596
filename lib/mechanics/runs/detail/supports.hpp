#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

namespace tunica {

/// Fills `held` and `prescribed`: the union of the fixes, statically determinate supports of what these and beds leave
/// free in every piece of a body that is held by its rigid motions (static runs), and nodes that no triangle uses.
/// Errors: InputError when two fixes ask for different displacements of one component, or for a part of a node's
/// freedoms where another lets it slide.
void make_supports(ShellSystem& system);

/// Lets edges keep their shape of which fixes hold the translations of both ends, and those of rims that are attached:
/// one that cannot move across itself does not bow in its plane, and if it cannot move along the normal either it does
/// not bulge.
/// So the reactions of translations are in balance with a constant tension, whatever holds the rotations, and the
/// energy of a wall in tension is that of a surface whose held edges rest: never below zero. Bow and bulge of an edge
/// with one triangle would move it, and a thin wall in tension would gain by that without bound. Bows of flat facets
/// stay where the drilling rotations are held: there the bending rotations have a part in them. Where a direction is
/// held by a part, a part of bow and bulge goes (squares of cosines). Edges of curved elements under an edge load are
/// as edges that are held: else a thin wall would buckle where it is pulled. Needs the elements and the carried nodes;
/// to be called before the terms are made.
void keep_held_edges(ShellSystem& system);

/// Holds as many translations of nodes far apart as a piece has free rigid motions, and stops nothing else: their
/// reactions vanish when the loads are in balance.
void hold_free_motions(ShellSystem& system, const Piece& piece);

/// Sets a piece's `shifts` and `turns` to what its held freedoms and beds leave free.
void set_free_motions(const ShellSystem& system, Piece& piece);

/// Number of rigid motions of a piece that its held freedoms and beds leave free (0 ... 6).
int free_rigid_motions(const ShellSystem& system, const Piece& piece);

/// The rigid motions of a piece, displaced as in `configuration`, that its held freedoms and beds leave free: 6 per
/// node, of all nodes; lengths of order one.
std::vector<VectorX> free_rigid_modes(const ShellSystem& system, const Piece& piece,
                                      const Configuration& configuration);

/// Net load that the supports of a body held by its rigid motions may carry, relative to the load.
inline constexpr double largest_imbalance = 1e-3;

/// Net force and moment of all loads at their full value on a piece along its balanced motions, relative to the sum of
/// their magnitudes.
double imbalance(const ShellSystem& system, const Piece& piece, const VectorX& external);

/// Whether a body is held by its rigid motions.
bool held_by_rigid_motions(const Model& model, std::size_t body);

/// Releases the supports of bodies held by their rigid motions: in a dynamic run inertia holds them.
void release_rigid_motion_supports(ShellSystem& system);

/// The rigid motion of a piece that leaves the mean displacement and the mean rotation, weighted by area, at zero is
/// added to its nodes, or of it what nothing else holds. Follower loads and internal forces only turn with it.
void take_out_rigid_motion(const ShellSystem& system, const Piece& piece, Configuration& configuration);

/// The same in the linear theory, on 6 numbers per node, for the bodies that are held by their rigid motions.
void take_out_linear_rigid_motion(const ShellSystem& system, VectorX& displacement);

}  // namespace tunica
