#include "tunica/core/require.hpp"
#include "tunica/fit/relax.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"

#include <algorithm>
#include <tuple>

namespace tunica {
namespace {

constexpr double rounding = 1e-9;  // of the diagonal: by which a certified interval may be wider than asked

Interval intersection(const Interval& a, const Interval& b) {
  return {std::max(a.lower, b.lower), std::min(a.upper, b.upper)};
}

}  // namespace

ShellDistance certified_distance(const RelaxResult& relaxed, const Target& whole, double moved,
                                 const ShellDistanceOptions& measuring) {
  require_not_negative(moved, "how far the target was moved");
  const auto widened = [&](const Interval& known) {
    return Interval{std::max(0.0, known.lower - moved), known.upper + moved};
  };
  ShellDistance distance = relaxed.distance;
  for (Interval* known : {&distance.both, &distance.shell_to_target, &distance.target_to_shell}) {
    *known = widened(*known);
  }
  const auto narrow = [&](const Interval& known) {
    return known.upper - known.lower <= measuring.width + rounding * whole.diagonal();
  };
  if (!narrow(distance.shell_to_target) || !narrow(distance.target_to_shell)) {
    // Both intervals are certain, so their intersection is.
    const ShellDistance measured = shell_distance(relaxed.shell, whole, measuring);
    distance.both = intersection(distance.both, measured.both);
    distance.shell_to_target = intersection(distance.shell_to_target, measured.shell_to_target);
    distance.target_to_shell = intersection(distance.target_to_shell, measured.target_to_shell);
  }
  std::tie(distance.mean, distance.rms) = mean_distance(relaxed.shell, whole);
  if (const auto between = boundary_distance(boundary_curves(relaxed.shell), whole, measuring.width)) {
    const auto& known = relaxed.distance.boundary;
    distance.boundary = known ? intersection(between->both, widened(*known)) : between->both;
  }
  return distance;
}

}  // namespace tunica
