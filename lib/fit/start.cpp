#include "tunica/fit/detail/start.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/fit/detail/fit_mesh.hpp"
#include "tunica/shell/distance/normals.hpp"
#include "tunica/surface/decimation/decimate.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

constexpr double crease_angle = 60;           // degrees
constexpr double crease_length = 0.15;        // of the diagonal: less is texture, such as that of voxels
constexpr double crease_share = 0.6;          // of the angle: coarser facets turn by less
constexpr double close_by = 0.2;              // of an edge's length: a chord leaves a curved crease
constexpr std::size_t sample_count = 20'000;  // vertices, and facets: for the error of flat facets
constexpr std::size_t first_rung = 4000;      // triangles of the first decimation, from which the count is judged

/// Largest sampled distance between flat facets and target, both ways, mm.
double sampled_error(const TriangleMesh& mesh, const Target& target) {
  const auto largest = [](const TriangleMesh& points, const ClosestPoint& surface) {
    const auto distances = vertex_distances(points, surface);
    return *std::max_element(distances.begin(), distances.end());
  };
  TriangleMesh some;
  const auto& vertices = target.mesh().vertices;
  for (std::size_t v = 0; v < vertices.size(); v += std::max<std::size_t>(1, vertices.size() / sample_count)) {
    some.vertices.push_back(vertices[v]);
  }
  const double to_mesh = largest(some, ClosestPoint(mesh));
  some.vertices.clear();
  for (std::size_t t = 0; t < mesh.triangles.size();
       t += std::max<std::size_t>(1, mesh.triangles.size() / sample_count)) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 &p = mesh.vertices[a], &q = mesh.vertices[b], &r = mesh.vertices[c];
    some.vertices.insert(some.vertices.end(), {(p + q + r) / 3, (p + q) / 2, (q + r) / 2, (r + p) / 2});
  }
  return std::max(to_mesh, largest(some, target.tree()));
}

using EdgeFlags = std::vector<std::array<bool, 3>>;

double turn_degrees(const Vec3& a, const Vec3& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * 180 / std::numbers::pi;
}

/// The target's creases: connected edges that turn by `crease_angle`, long together; what is short is texture.
std::optional<ClosestPoint> crease_curves(const Target& target) {
  const TriangleMesh& mesh = target.mesh();
  const auto across = neighbours(mesh, incidence(mesh));
  DisjointSets curves(mesh.vertices.size());
  std::vector<std::array<Index, 2>> edges;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = across[t][k];
      if (other != no_neighbour && t < other &&
          turn_degrees(target.facet_normals()[t], target.facet_normals()[other]) > crease_angle) {
        edges.push_back({mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]});
        curves.join(edges.back()[0], edges.back()[1]);
      }
    }
  }
  std::vector<double> length(mesh.vertices.size(), 0);
  for (const auto& [u, v] : edges) {
    length[curves.root(u)] += (mesh.vertices[u] - mesh.vertices[v]).norm();
  }
  std::vector<std::array<Vec3, 2>> segments;
  for (const auto& [u, v] : edges) {
    if (length[curves.root(u)] >= crease_length * target.diagonal()) {
      segments.push_back({mesh.vertices[u], mesh.vertices[v]});
    }
  }
  if (segments.empty()) {
    return {};
  }
  return ClosestPoint(segments_as_triangles(segments));
}

/// Edges of the mesh across which facets turn, and that follow a crease of the target.
EdgeFlags sharp_edges(const TriangleMesh& mesh, const ClosestPoint& creases, const std::vector<Vec3>& facets,
                      const std::vector<std::array<Index, 3>>& across) {
  EdgeFlags sharp(mesh.triangles.size(), {false, false, false});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = across[t][k];
      if (other == no_neighbour || other < t || turn_degrees(facets[t], facets[other]) < crease_share * crease_angle) {
        continue;
      }
      const Index u = mesh.triangles[t][k], v = mesh.triangles[t][(k + 1) % 3];
      const Vec3 &a = mesh.vertices[u], &b = mesh.vertices[v];
      const double near = close_by * (b - a).norm();
      const auto is_near = [&](const Vec3& p) { return (creases.closest(p).point - p).norm() < near; };
      const auto& w = mesh.triangles[other];
      const std::size_t l = std::find(w.begin(), w.end(), v) - w.begin();
      sharp[t][k] = sharp[other][l] = is_near(a) && is_near(b) && is_near((a + b) / 2);
    }
  }
  return sharp;
}

/// The triangles around a node, by the side of the creases that they are on.
std::vector<std::vector<Index>> sides_around(const TriangleMesh& mesh, const EdgeFlags& sharp,
                                             const std::vector<std::array<Index, 3>>& across, Index node,
                                             std::span<const Index> around) {
  std::vector<Index> open(around.begin(), around.end());
  std::vector<std::vector<Index>> sides;
  while (!open.empty()) {
    std::vector<Index> side{open.back()};
    open.pop_back();
    for (std::size_t i = 0; i < side.size(); ++i) {
      const Index t = side[i];
      for (std::size_t k = 0; k < 3; ++k) {
        const bool at_node = mesh.triangles[t][k] == node || mesh.triangles[t][(k + 1) % 3] == node;
        const auto found = at_node && !sharp[t][k] ? std::find(open.begin(), open.end(), across[t][k]) : open.end();
        if (found != open.end()) {
          side.push_back(*found);
          open.erase(found);
        }
      }
    }
    sides.push_back(std::move(side));
  }
  return sides;
}

/// Mean of the facets' normals at a node, by their angles there.
Vec3 mean_normal(const TriangleMesh& mesh, const std::vector<Vec3>& facets, Index node,
                 const std::vector<Index>& triangles) {
  Vec3 sum = Vec3::Zero();
  for (const Index t : triangles) {
    const auto& v = mesh.triangles[t];
    const std::size_t c = std::find(v.begin(), v.end(), node) - v.begin();
    const Vec3 a = mesh.vertices[v[(c + 1) % 3]] - mesh.vertices[node];
    const Vec3 b = mesh.vertices[v[(c + 2) % 3]] - mesh.vertices[node];
    sum += std::atan2(a.cross(b).norm(), a.dot(b)) * facets[t];
  }
  return sum.norm() > 1e-6 ? Vec3(sum.normalized()) : facets[triangles[0]];
}

void set_corner_normals(ShellMesh& shell, Index node, const std::vector<Index>& triangles, const Vec3& normal) {
  if (shell.corner_normals.empty()) {
    for (const auto& [a, b, c] : shell.triangles) {
      shell.corner_normals.push_back({shell.normals[a], shell.normals[b], shell.normals[c]});
    }
  }
  for (const Index t : triangles) {
    const auto& corners = shell.triangles[t];
    const std::size_t k = std::find(corners.begin(), corners.end(), node) - corners.begin();
    shell.corner_normals[t][k] = normal;
  }
}

}  // namespace

bool same_topology(const TriangleMesh& mesh, const Target& target) {
  if (mesh.triangles == target.mesh().triangles) {
    return true;
  }
  const MeshFacts x = examine(mesh), y = examine(target.mesh());
  const auto agree = [&](std::size_t closed) {
    return x.boundary_loops + closed == y.boundary_loops && x.euler == y.euler + narrow<long>(closed);
  };
  return x.components == y.components && (agree(0) || agree(target.point_loops()));
}

TriangleMesh decimation(const Target& target, std::size_t triangles) {
  DecimateOptions options;
  options.triangles = std::max<std::size_t>(triangles, 4);
  options.levelled = false;
  return decimate(target.mesh(), options).mesh;
}

TriangleMesh decimation_within(const Target& target, double error) {
  TriangleMesh mesh = decimation(target, std::min(first_rung, target.mesh().triangles.size()));
  for (int rung = 0; rung < 2; ++rung) {
    const double wanted = real(mesh.triangles.size()) * sampled_error(mesh, target) / error;
    if (wanted >= real(target.mesh().triangles.size())) {
      return target.mesh();
    }
    mesh = decimation(target, truncated<std::size_t>(wanted));
  }
  return mesh;
}

ShellMesh shells_on(const Target& target, const TriangleMesh& mesh, Patch patch) {
  ShellMesh shell;
  shell.vertices = mesh.vertices;
  shell.triangles = mesh.triangles;
  shell.patch = patch;
  take_normals_from(target, shell);
  const auto creases = crease_curves(target);
  if (!creases) {
    return shell;
  }
  const auto facets = facet_normals(mesh);
  const Incidence around = incidence(mesh);
  const auto across = neighbours(mesh, around);
  const EdgeFlags sharp = sharp_edges(mesh, *creases, facets, across);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto node = narrow<Index>(v);
    const auto sides = sides_around(mesh, sharp, across, node, around.of(node));
    if (sides.size() > 1) {
      for (const auto& side : sides) {
        set_corner_normals(shell, node, side, mean_normal(mesh, facets, node, side));
      }
    }
  }
  return shell;
}

ShellMesh creased_where_folded(ShellMesh shell) {
  const TriangleMesh mesh = flat_facets(shell);
  const auto facets = facet_normals(mesh);
  std::vector<Index> folded;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (shell.normal(t, k).dot(facets[t]) < fit_agreement) {
        folded.push_back(mesh.triangles[t][k]);
      }
    }
  }
  std::sort(folded.begin(), folded.end());
  folded.erase(std::unique(folded.begin(), folded.end()), folded.end());
  if (folded.empty()) {
    return shell;
  }
  const Incidence around = incidence(mesh);
  const auto across = neighbours(mesh, around);
  EdgeFlags sharp(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      sharp[t][k] = across[t][k] != no_neighbour && turn_degrees(facets[t], facets[across[t][k]]) > crease_angle;
    }
  }
  for (const Index node : folded) {
    for (const auto& side : sides_around(mesh, sharp, across, node, around.of(node))) {
      std::vector<Vec3> fan;
      for (const Index t : side) {
        fan.push_back(facets[t]);
      }
      const CompatibleNormal normal = most_compatible_normal(fan);
      if (normal.agreement > fit_agreement) {
        set_corner_normals(shell, node, side, normal.normal);
        continue;
      }
      for (const Index t : side) {
        set_corner_normals(shell, node, {t}, facets[t]);
      }
    }
  }
  return shell;
}

}  // namespace tunica
