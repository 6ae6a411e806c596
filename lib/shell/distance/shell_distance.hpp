#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace tunica {

/// A place that is farther from the other surface than it should be.
struct FarPlace {
  Vec3 point;
  Index patch;      ///< of the shells: its own, or that of the closest point
  Vec2 at;          ///< likewise
  double distance;  ///< mm
};

/// How far the curved surface of a shell mesh and a target lie apart, mm.
struct ShellDistance {
  Interval both;  ///< two-sided Hausdorff distance
  Interval shell_to_target;
  Interval target_to_shell;
  double mean = 0;  ///< of the distance from the curved surface to the target, over its area
  double rms = 0;
  Vec3 farthest_of_shell = Vec3::Zero();              ///< a point of the curved surface that has shell_to_target.lower
  Vec3 farthest_of_target = Vec3::Zero();             ///< a point of the target that has target_to_shell.lower
  Vec3 closest_to_farthest_of_target = Vec3::Zero();  ///< of the curved surface
  /// Where these are listed: one place of each patch that is beyond the limit or nearly, and of the target likewise.
  std::vector<FarPlace> beyond_of_shell = {};
  std::vector<FarPlace> beyond_of_target = {};
  /// Two-sided, of the boundary curves; none where either has no boundary, or it was not asked for.
  std::optional<Interval> boundary = {};

  /// mm: surfaces, and boundaries where these were measured, are certainly at most so far apart.
  [[nodiscard]] double upper() const { return boundary ? std::max(both.upper, boundary->upper) : both.upper; }
};

struct ShellDistanceOptions {
  double width = 0;             ///< mm: upper - lower wanted of each interval
  bool with_mean = false;       ///< mean and rms too
  std::optional<double> limit;  ///< mm: whether the distance is at most this is all that matters
  bool list_beyond = false;     ///< and where it is not: in the whole, not only until that is certain
  Progress progress;
};

/// Certified, see curved_hausdorff.hpp. Where a patch is so wild that this would take some million cuts the intervals
/// come out wider. Errors of all functions here: InputError as require_shells(), and where a width, limit or
/// deviation is negative or not finite.
ShellDistance shell_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options);

/// Mean and root mean square (mm) of the distance from the curved surface to the target, over its area, by some 20,000
/// samples.
std::pair<double, double> mean_distance(const ShellMesh& shell, const Target& target);

/// shell_distance() of the flat facets.
ShellDistance flat_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options);

/// Largest sampled distance of each shell, mm: of points of its patch from the target, and of the target's vertices and
/// centroids whose closest patch it is, and of those over the gaps between patches.
std::vector<double> shell_errors(const ShellMesh& shell, const Target& target, double deviation);

}  // namespace tunica
