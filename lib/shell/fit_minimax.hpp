#pragma once

#include "shell/fit_state.hpp"

#include <optional>

namespace tunica {

/// Lessens the largest residual of all patches, by steps of all nodes that are not held and their normals at once. Each
/// step takes the residuals as linear and finds where the largest of them is least: a linear programme, damped by how
/// far residuals, nodes and normals move, solved to 1 %. What comes of it is measured, and kept where the largest error
/// is less; else the step is damped more. The state must have been attached and measured, and is so in the end, by
/// FitState::attach_again().
/// @param enough     mm: an error that ends the work
/// @param steps      at most
/// @param limit      mm: an error to come below; where what is foretold of a step makes that unlikely the work ends
/// @return the largest error left, mm
/// Keeps: what FitLimits asks of facets. Source: Osborne, Watson, An algorithm for minimax approximation in the
/// nonlinear case, Comput. J. 1969; Mehrotra, On the implementation of a primal-dual interior point method, SIAM J.
/// Optim. 1992. Cost: per step some ten, at most sixty, sparse factorisations of five unknowns per node.
double lessen_largest(FitState& state, double enough, int steps, std::optional<double> limit = {});

}  // namespace tunica
