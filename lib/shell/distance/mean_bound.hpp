#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

namespace tunica {

/// What the mean distance of shells and target, over area, is certainly not above, mm: the larger of both ways.
/// The distance to one triangle is convex, so that its mean over another is at most that of the corners; where a
/// triangle lies over several the largest distance bounds the mean (CoverBound). Triangles are cut where both are far
/// above what the corners' own closest points say.
/// @param slack  mm, about how far above the mean this may lie
/// Cost: as a certificate of the largest distance that is as wide. Parallel.
double mean_distance_bound(const ShellMesh& shell, const Target& target, double slack);

}  // namespace tunica
