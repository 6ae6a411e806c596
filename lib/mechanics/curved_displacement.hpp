#pragma once

#include "mechanics/solve.hpp"
#include "shell/curved_surface.hpp"

namespace tunica {

/// Where a state moves the curved surface of a body: at each vertex of a tessellation the point of the deformed patch
/// (nodes displaced, normals turned with them) minus the same point of the reference patch, so that the deformed body
/// is as curved as the model is. Where a patch has no deformed counterpart (a normal turned into its facet's plane),
/// the nodes' displacements are interpolated linearly.
/// @param state  global node order; `surface` is a tessellation of the body's own mesh
/// @return #V displacements, mm
std::vector<Vec3> curved_displacement(const Model& model, std::size_t body, const State& state,
                                      const Tessellation& surface);

}  // namespace tunica
