#include "tunica/shell/distance/shell_quality.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr std::size_t samples = 20'000;
constexpr std::size_t shells_per_block = 64;
constexpr double crease_cosine = 0.766;  // of 40 degrees
constexpr int pieces_of_an_edge = 16;

/// Triangles of the target beside a crease.
std::vector<std::uint8_t> creased_triangles(const Target& target) {
  const auto& normals = target.facet_normals();
  std::vector<std::uint8_t> creased(normals.size(), 0);
  for (std::size_t t = 0; t < normals.size(); ++t) {
    for (const Index other : target.across()[t]) {
      creased[t] |= other != no_neighbour && normals[t].dot(normals[other]) < crease_cosine ? 1 : 0;
    }
  }
  return creased;
}

void add_normal_errors(const std::vector<CubicPatch>& patches, const Target& target, ShellQuality& quality) {
  struct Sum {
    double area = 0, angle = 0, largest = 0;
  };
  const auto creased = creased_triangles(target);
  const int level = std::clamp(truncated<int>(std::sqrt(real(samples) / real(patches.size()))), 2, 12);
  std::vector<Sum> sums((patches.size() + shells_per_block - 1) / shells_per_block);
  parallel_for_blocks(patches.size(), shells_per_block, [&](std::size_t begin, std::size_t end) {
    Sum& sum = sums[begin / shells_per_block];
    for (std::size_t t = begin; t < end; ++t) {
      for (int r = 0; r < level; ++r) {
        for (int c = 0; c < level - r; ++c) {
          const Vec2 at((c + 1.0 / 3) / level, (r + 1.0 / 3) / level);
          const Vec3 p = patches[t].point(at);
          if (creased[target.tree().closest(p).triangle] != 0) {
            continue;
          }
          const auto [u, v] = patches[t].tangents(at);
          const Vec3 normal = u.cross(v);
          const Vec3 wanted = target.closest(p).normal;
          const double angle = std::atan2(normal.cross(wanted).norm(), normal.dot(wanted)) * 180 / std::numbers::pi;
          sum.area += normal.norm();
          sum.angle += normal.norm() * angle;
          sum.largest = std::max(sum.largest, angle);
        }
      }
    }
  });
  double area = 0;
  for (const Sum& sum : sums) {
    area += sum.area;
    quality.mean_normal_error += sum.angle;
    quality.max_normal_error = std::max(quality.max_normal_error, sum.largest);
  }
  quality.mean_normal_error /= std::max(area, 1e-300);
}

void add_neighbours(const ShellMesh& shell, const std::vector<CubicPatch>& patches, ShellQuality& quality) {
  const TriangleMesh flat = flat_facets(shell);
  const auto across = neighbours(flat, incidence(flat));
  for (std::size_t t = 0; t < across.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = across[t][k];
      if (other == no_neighbour || other < t) {
        continue;
      }
      const double a = longest_edge(flat, narrow<Index>(t)), b = longest_edge(flat, other);
      quality.size_ratio = std::max({quality.size_ratio, a / b, b / a});
      const auto& v = shell.triangles[other];
      const auto l = narrow<std::size_t>(std::find(v.begin(), v.end(), shell.triangles[t][(k + 1) % 3]) - v.begin());
      const CubicCurve here = edge_curve(patches[t], k), there = edge_curve(patches[other], l);
      for (int i = 1; i < pieces_of_an_edge; ++i) {
        const double s = real(i) / pieces_of_an_edge;
        quality.gap = std::max(quality.gap, (point_on(here, s) - point_on(there, 1 - s)).norm());
      }
    }
  }
}

}  // namespace

double mean_distance_from_target(const ShellMesh& shell, const Target& target) {
  require_shells(shell);
  const int level = std::clamp(truncated<int>(std::sqrt(10.0 * real(samples) / real(shell.triangles.size()))), 4, 24);
  const ClosestPoint tree(tessellate_uniformly(shell, level).mesh);
  const TriangleMesh& mesh = target.mesh();
  TriangleMesh centroids;
  std::vector<double> areas;
  const std::size_t stride = std::max<std::size_t>(1, mesh.triangles.size() / (5 * samples));
  for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
    const auto& [a, b, c] = mesh.triangles[t];
    centroids.vertices.emplace_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
    areas.push_back(triangle_area(mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]));
  }
  std::vector<double> distances(areas.size());
  parallel_for_blocks(areas.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      distances[i] = std::sqrt(tree.closest(centroids.vertices[i]).squared_distance);
    }
  });
  double sum = 0, area = 0;
  for (std::size_t i = 0; i < areas.size(); ++i) {
    sum += areas[i] * distances[i];
    area += areas[i];
  }
  return sum / std::max(area, 1e-300);
}

ShellQuality shell_quality(const ShellMesh& shell, const Target& target) {
  require_shells(shell);
  ShellQuality quality;
  const auto patches = curved_patches(shell);
  quality.mean_distance = std::max(mean_distance(shell, target).first, mean_distance_from_target(shell, target));
  add_normal_errors(patches, target, quality);
  add_neighbours(shell, patches, quality);
  return quality;
}

}  // namespace tunica
