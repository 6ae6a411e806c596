#include "tunica/shell/distance/curved_hausdorff.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/shell/distance/detail/certificate.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace tunica {
namespace {

double rounding_of(const ShellMesh& shell, const Target& target) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  const Box a = bounding_box(flat_facets(shell)), b = bounding_box(target.mesh());
  // Patches leave the box of their nodes by less than its diagonal.
  const double reach = 2 * (a.upper.cwiseMax(b.upper) - a.lower.cwiseMin(b.lower)).norm();
  const double coordinate =
      std::max(a.lower.cwiseAbs().cwiseMax(a.upper.cwiseAbs()).maxCoeff(), b.upper.cwiseAbs().maxCoeff());
  return target.tree().rounding(reach) + 256 * epsilon * (coordinate + reach);
}

/// Searches among coordinates that are no numbers would not end.
void require_finite(const ShellMesh& shell, const std::vector<CubicPatch>& patches) {
  for (std::size_t t = 0; t < patches.size(); ++t) {
    const auto& control = patches[t].control;
    if (!std::all_of(control.begin(), control.end(), [](const Vec3& p) { return p.allFinite(); })) {
      const Vec3& at = shell.vertices[shell.triangles[t][0]];
      throw InputError(
          fmt::format("a triangle at ({:.6g}, {:.6g}, {:.6g}) mm has no area, or a normal in its own plane: no curved "
                      "surface lies over it; make the mesh anew without such triangles",
                      at.x(), at.y(), at.z()));
    }
  }
}

}  // namespace

ShellDistance curved_hausdorff(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  require_shells(shell);
  require_not_negative(options.width, "the width of the interval");
  if (options.limit) {
    require_not_negative(*options.limit, "the limit of the distance");
  }
  const std::vector<CubicPatch> patches = curved_patches(shell);
  require_finite(shell, patches);
  const Aim aim{options.width, options.limit, rounding_of(shell, target), options.list_beyond && options.limit};
  ShellDistance out;
  OneSided from_shell = shell_to_target(patches, target, aim);
  tunica::advance(options.progress, 0.5);
  OneSided from_target = target_to_shell(shell, patches, SurfaceInOrder::of(target), aim, from_shell.distance.lower);
  out.shell_to_target = from_shell.distance;
  out.target_to_shell = from_target.distance;
  out.beyond_of_shell = std::move(from_shell.beyond);
  out.beyond_of_target = std::move(from_target.beyond);
  out.farthest_of_shell = from_shell.farthest;
  out.farthest_of_target = from_target.farthest;
  out.closest_to_farthest_of_target = from_target.closest;
  out.both = {std::max(out.shell_to_target.lower, out.target_to_shell.lower),
              std::max(out.shell_to_target.upper, out.target_to_shell.upper)};
  out.mean = out.rms = std::numeric_limits<double>::quiet_NaN();
  if (options.with_mean) {
    std::tie(out.mean, out.rms) = mean_distance(shell, target);
  }
  tunica::advance(options.progress, 1);
  return out;
}

}  // namespace tunica
