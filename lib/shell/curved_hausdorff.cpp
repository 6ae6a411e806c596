#include "shell/curved_hausdorff.hpp"

#include "core/threads.hpp"
#include "shell/certificate.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace tunica {
namespace {

constexpr std::size_t grain = 256;
constexpr std::size_t mean_samples = 60'000;

double rounding_of(const ShellMesh& shell, const Target& target) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  const Box a = bounding_box(flat_facets(shell)), b = bounding_box(target.mesh());
  // Patches leave the box of their nodes by less than its diagonal.
  const double reach = 2 * (a.upper.cwiseMax(b.upper) - a.lower.cwiseMin(b.lower)).norm();
  const double coordinate =
      std::max(a.lower.cwiseAbs().cwiseMax(a.upper.cwiseAbs()).maxCoeff(), b.upper.cwiseAbs().maxCoeff());
  return target.tree().rounding(reach) + 256 * epsilon * (coordinate + reach);
}

/// Mean and root mean square of the distance from the curved surface, by the midpoints of its pieces.
std::pair<double, double> means(const std::vector<CubicPatch>& patches, const Target& target) {
  struct Sum {
    double area = 0, distance = 0, squared = 0;
  };
  const double per_patch = static_cast<double>(mean_samples) / static_cast<double>(patches.size());
  const int level = std::clamp(static_cast<int>(std::sqrt(per_patch)), 2, 40);
  std::vector<Sum> sums((patches.size() + grain - 1) / grain);
  parallel_for_blocks(patches.size(), grain, [&](std::size_t begin, std::size_t end) {
    Sum& sum = sums[begin / grain];
    std::optional<Index> guess;
    for (std::size_t t = begin; t < end; ++t) {
      const auto add = [&](double c, double r) {
        const Vec2 at(c / level, r / level);
        const auto [u, v] = patches[t].tangents(at);
        const double area = u.cross(v).norm() / (2.0 * level * level);
        const Vec3 p = patches[t].point(at);
        const auto hit = guess ? target.tree().closest(p, *guess) : target.tree().closest(p);
        guess = hit.triangle;
        sum.area += area;
        sum.distance += area * std::sqrt(hit.squared_distance);
        sum.squared += area * hit.squared_distance;
      };
      for (int r = 0; r < level; ++r) {
        for (int c = 0; c < level - r; ++c) {
          add(c + 1.0 / 3, r + 1.0 / 3);
          if (c + 1 < level - r) {
            add(c + 2.0 / 3, r + 2.0 / 3);
          }
        }
      }
    }
  });
  Sum total;
  for (const Sum& sum : sums) {
    total.area += sum.area;
    total.distance += sum.distance;
    total.squared += sum.squared;
  }
  return {total.distance / total.area, std::sqrt(total.squared / total.area)};
}

}  // namespace

ShellDistance curved_hausdorff(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  const std::vector<CubicPatch> patches = curved_patches(shell);
  const Aim aim{options.width, options.limit, rounding_of(shell, target)};
  ShellDistance out;
  const OneSided from_shell = shell_to_target(patches, target, aim);
  tunica::advance(options.progress, 0.5);
  const OneSided from_target = target_to_shell(shell, patches, target, aim, from_shell.distance.lower);
  out.shell_to_target = from_shell.distance;
  out.target_to_shell = from_target.distance;
  out.farthest_of_shell = from_shell.farthest;
  out.farthest_of_target = from_target.farthest;
  out.closest_to_farthest_of_target = from_target.closest;
  out.both = {std::max(out.shell_to_target.lower, out.target_to_shell.lower),
              std::max(out.shell_to_target.upper, out.target_to_shell.upper)};
  out.mean = out.rms = std::numeric_limits<double>::quiet_NaN();
  if (options.with_mean) {
    std::tie(out.mean, out.rms) = means(patches, target);
  }
  tunica::advance(options.progress, 1);
  return out;
}

}  // namespace tunica
