#pragma once

#include "tunica/shell/distance/shell_distance.hpp"

namespace tunica {

/// The certified two-sided distance of a curved shell mesh and a target, without a tessellation: from the shell, parts
/// of patches are bounded by the distance of their chord triangle and how far they bulge from it; to the shell, pieces
/// of the target's triangles are bounded point by point against the part of one patch between the feet of their
/// corners. What a bound does not settle is cut; both bounds gain a factor of four by halving. The same whatever the
/// number of threads.
/// @param options  as for shell_distance()
/// Limits: where a patch is so wild that a bound would take more than two million cuts, intervals come out wider.
/// Cost: about 30 queries of the target per shell, 3 us per triangle of the target; little more for narrow widths.
ShellDistance curved_hausdorff(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options);

}  // namespace tunica
