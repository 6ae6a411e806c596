#include "shell/shell_distance.hpp"

#include "core/threads.hpp"
#include "shell/curved_surface.hpp"
#include "surface/hausdorff.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t most_fine_triangles = 4'000'000;

Tessellation affordable_tessellation(const ShellMesh& shell, double deviation) {
  while (tessellation_size(shell, deviation) > static_cast<double>(most_fine_triangles)) {
    deviation *= 2;
  }
  return tessellate(shell, deviation);
}

ShellDistance distance(const TriangleMesh& mesh, double deviation, double width, const Target& target,
                       const ShellDistanceOptions& options) {
  HausdorffOptions hausdorff_options;
  hausdorff_options.width = width;
  hausdorff_options.deviation_a = deviation;
  hausdorff_options.limit = options.limit;
  if (!options.with_mean) {
    hausdorff_options.samples = 0;
  }
  hausdorff_options.progress = options.progress;
  const HausdorffResult result = hausdorff(ClosestPoint(mesh), target.tree(), hausdorff_options);
  return {result.both, result.a_to_b, result.b_to_a, result.mean, result.rms};
}

}  // namespace

ShellDistance shell_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  // An eighth of the width for the tessellation, which widens the interval by twice that.
  const Tessellation fine = affordable_tessellation(shell, options.width / 8);
  return distance(fine.mesh, fine.deviation, 0.75 * options.width, target, options);
}

ShellDistance flat_distance(const ShellMesh& shell, const Target& target, const ShellDistanceOptions& options) {
  return distance(flat_facets(shell), 0, options.width, target, options);
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
  const std::size_t vertices = mesh.vertices.size();
  std::vector<ClosestPoint::Hit> hits(vertices + mesh.triangles.size());
  parallel_for_blocks(hits.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (i < vertices) {
        hits[i] = tree.closest(mesh.vertices[i]);
      } else {
        const auto& [a, b, c] = mesh.triangles[i - vertices];
        hits[i] = tree.closest((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
      }
    }
  });
  for (const auto& hit : hits) {
    double& error = errors[fine.shell[hit.triangle]];
    error = std::max(error, std::sqrt(hit.squared_distance));
  }
  return errors;
}

}  // namespace tunica
