#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

namespace tunica {

/// What the answer to a load depends on besides the largest distance.
struct ShellQuality {
  double mean_distance = 0;      ///< mm: the larger of the two one-sided means over area
  double mean_normal_error = 0;  ///< degrees, of the curved surface's normal against the target's at its closest point
  double max_normal_error = 0;   ///< degrees; both away from the target's creases
  double gap = 0;         ///< mm: largest distance of two neighbouring patches along their common edge, at equal parts
  double size_ratio = 1;  ///< largest ratio of the longest edges of two neighbouring facets
};

/// Mean distance, mm, from the target to the curved surface over the target's area, by the centroids of some 100,000 of
/// its triangles at most. Errors: InputError as require_shells(). Cost: about 0.1 s. Parallel.
double mean_distance_from_target(const ShellMesh& shell, const Target& target);

/// Sampled: some 20,000 points of the curved surface, and the target's centroids. A crease is an edge of the target
/// with a dihedral above 40 degrees; points whose closest triangle has one are left out of the normals' errors.
/// Cost: about 0.1 s. Parallel.
ShellQuality shell_quality(const ShellMesh& shell, const Target& target);

}  // namespace tunica
