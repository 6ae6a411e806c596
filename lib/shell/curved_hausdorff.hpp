#pragma once

#include "shell/shell_distance.hpp"

namespace tunica {

/// The certified two-sided distance of a curved shell mesh and a target, without a tessellation that is fine
/// everywhere: from the shell, parts of patches are bounded by the distance of their chord triangle and how far they
/// bulge from it, and cut only where that does not do; to the shell, the target's triangles are bounded against a
/// coarse surface whose neighbours are joined, each triangle with its own deviation, and what is left against ever
/// finer ones of the patches nearby.
/// @param options  as for shell_distance()
/// Limits: where a patch is so wild that a bound would take more than some million cuts, intervals come out wider.
/// Cost: per shell about 30 queries of the target, per triangle of the target about 2 us.
ShellDistance curved_hausdorff(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options);

}  // namespace tunica
