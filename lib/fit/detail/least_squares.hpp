#pragma once

#include "tunica/fit/detail/samples.hpp"

namespace tunica {

struct SquaresOptions {
  FacetLimits shape;                ///< facets that keep them go on keeping them, others get no worse
  bool largest = false;             ///< the largest residuals are lessened, else their mean
  bool smooth = false;              ///< nodes are pulled towards the middle of their neighbours, within the surface
  bool positions = true;            ///< else only the normals turn
  double search_beyond = infinity;  ///< see FitSamples::measure()
};

/// Moves the free nodes of a piece and turns their normals by one Gauss-Newton step on the residuals, weighted by
/// (|residual| / largest)^2 where the largest count. Node by node the step is shortened, or left out, where the sum of
/// the powers around it would grow or a facet would lose its shape. One node, a ring or a whole mesh: the same step.
/// @param piece  measured; its residuals and errors are kept up to date
/// @return the part of the sum that is left, at most 1
/// Source: Gauss-Newton with Levenberg's damping; iteratively reweighted where the largest count. Cost: three
/// measurements of the piece, more where steps are shortened. The result does not depend on the number of threads.
double least_squares_step(FitPiece& piece, const FitSamples& samples, const SquaresOptions& options);

}  // namespace tunica
