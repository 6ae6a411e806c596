// mechanics/runs: statics, dynamics, load paths, modes.
#pragma once

#include "tunica/mechanics/runs/solve.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

namespace tunica {

/// Where a state moves the curved surface of a body: at each vertex of a tessellation the point of the moved patch
/// minus the same point of the reference patch, so that the deformed body is as curved as the model is. The moved patch
/// stands on the moved facet, with the slopes of the reference plus those of the corners' rotations relative to the
/// facet. Where a facet has collapsed, the nodes' displacements are interpolated linearly.
/// @param state  global node order; `surface` is a tessellation of the body's own mesh
/// @return #V displacements, mm
/// Errors of all functions here: InputError: a body, a corner or a patch that does not exist, coordinates or normals
/// that are not finite, a state of another model.
std::vector<Vec3> curved_displacement(const Model& model, std::size_t body, const State& state,
                                      const Tessellation& surface);

/// The largest displacement of the curved surfaces of all bodies, mm: as curved_displacement(), at nine points of every
/// patch and the nodes, and from the best of them on as far up as their patches go.
double largest_displacement(const Model& model, const State& state);

/// Shells with a corner that bends by more than `angle` (rad) relative to the facet: strains within a shell are small
/// no more, and a finer mesh will move differently. Zero for a linear run, whose rotations are small by assumption.
std::size_t count_unresolved(const Model& model, const State& state, double angle);

}  // namespace tunica
