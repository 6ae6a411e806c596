#include "tunica/shell/distance/shell_distance.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/curved_hausdorff.hpp"
#include "tunica/shell/distance/detail/certificate.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t mean_samples = 20'000;
constexpr std::size_t most_fine_triangles = 4'000'000;

Tessellation affordable_tessellation(const ShellMesh& shell, double deviation) {
  while (tessellation_size(shell, deviation) > real(most_fine_triangles)) {
    deviation *= 2;
  }
  return tessellate(shell, deviation);
}

/// For each inner edge three points midway between the edge curves of its two patches.
std::vector<Vec3> points_between_patches(const ShellMesh& shell) {
  const auto across = neighbours(flat_facets(shell), incidence(flat_facets(shell)));
  const auto patches = curved_patches(shell);
  const auto on_edge = [&](std::size_t t, std::size_t k, double s) {
    const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
    return patches[t].point((1 - s) * corners[k] + s * corners[(k + 1) % 3]);
  };
  std::vector<Vec3> points;
  for (std::size_t t = 0; t < across.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = across[t][k];
      if (other == no_neighbour || other < t) {
        continue;
      }
      const Index end = shell.triangles[t][(k + 1) % 3];
      const auto& v = shell.triangles[other];
      const std::size_t l = std::find(v.begin(), v.end(), end) - v.begin();
      for (const double s : {0.25, 0.5, 0.75}) {
        points.emplace_back((on_edge(t, k, s) + on_edge(other, l, 1 - s)) / 2);
      }
    }
  }
  return points;
}

}  // namespace

ShellDistance shell_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  return curved_hausdorff(shell, target, options);
}

std::pair<double, double> mean_distance(const ShellMesh& shell, const Target& target) {
  require_shells(shell);
  // By the midpoints of pieces of the patches.
  const std::vector<CubicPatch> patches = curved_patches(shell);
  struct Sum {
    double area = 0, distance = 0, squared = 0;
  };
  const double per_patch = real(mean_samples) / real(patches.size());
  const int level = std::clamp(truncated<int>(std::sqrt(per_patch)), 2, 40);
  std::vector<Sum> sums((patches.size() + items_per_block - 1) / items_per_block);
  parallel_for_blocks(patches.size(), items_per_block, [&](std::size_t begin, std::size_t end) {
    Sum& sum = sums[begin / items_per_block];
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

ShellDistance flat_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  HausdorffOptions hausdorff_options;
  hausdorff_options.width = options.width;
  hausdorff_options.limit = options.limit;
  if (!options.with_mean) {
    hausdorff_options.samples = 0;
  }
  hausdorff_options.progress = options.progress;
  const HausdorffResult result = hausdorff(ClosestPoint(flat_facets(shell)), target.tree(), hausdorff_options);
  return {result.both, result.a_to_b, result.b_to_a, result.mean, result.rms};
}

std::vector<double> shell_errors(const ShellMesh& shell, const Target& target, double deviation) {
  const Tessellation fine = affordable_tessellation(shell, deviation);
  std::vector<double> errors(shell.triangles.size(), 0);
  const auto from_shell = vertex_distances(fine.mesh, target.tree());
  for (std::size_t v = 0; v < from_shell.size(); ++v) {
    double& error = errors[fine.vertex_shell[v]];
    error = std::max(error, from_shell[v]);
  }
  const ClosestPoint tree(fine.mesh);
  const auto& mesh = target.mesh();
  std::vector<Vec3> points = mesh.vertices;
  for (const auto& [a, b, c] : mesh.triangles) {
    points.emplace_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
  }
  // Adjacent patches gape along their edge, more narrowly than the target's triangles: over the gap ask the target too.
  for (const Vec3& p : points_between_patches(shell)) {
    points.push_back(target.closest(p).point);
  }
  std::vector<ClosestPoint::Hit> hits(points.size());
  parallel_for_blocks(hits.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      hits[i] = tree.closest(points[i]);
    }
  });
  for (const auto& hit : hits) {
    double& error = errors[fine.shell[hit.triangle]];
    error = std::max(error, std::sqrt(hit.squared_distance));
  }
  return errors;
}

}  // namespace tunica
