#include "tunica/shell/distance/target.hpp"

#include "tunica/core/error.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <Eigen/Geometry>

#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t triangles_looked_at = 16;
constexpr double least_extent = 1e-9;  // of the diagonal: smaller boundary loops are points

// Of a corner from its triangle's centroid.
double largest_radius(const TriangleMesh& mesh, const std::vector<Vec3>& centroids) {
  double squared = 0;
  for (std::size_t t = 0; t < centroids.size(); ++t) {
    for (const Index v : mesh.triangles[t]) {
      squared = std::max(squared, (mesh.vertices[v] - centroids[t]).squaredNorm());
    }
  }
  return std::sqrt(squared);
}

std::vector<Vec3> centroids(const TriangleMesh& mesh) {
  std::vector<Vec3> out;
  out.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    out.emplace_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
  }
  return out;
}

/// Weights of the corners at a point of the triangle.
Vec3 barycentric(const Vec3& p, const std::array<Vec3, 3>& corners) {
  const Vec3 u = corners[1] - corners[0], v = corners[2] - corners[0], w = p - corners[0];
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), wu = w.dot(u), wv = w.dot(v);
  const double determinant = uu * vv - uv * uv;
  if (!(determinant > 1e-14 * uu * vv)) {
    return Vec3::Constant(1.0 / 3);
  }
  const double b2 = (vv * wu - uv * wv) / determinant, b3 = (uu * wv - uv * wu) / determinant;
  return Vec3(1 - b2 - b3, b2, b3).cwiseMax(0).cwiseMin(1);
}

}  // namespace

std::vector<Vec3> facet_normals(const TriangleMesh& mesh) {
  require_valid(mesh);
  std::vector<Vec3> out;
  out.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3& p = mesh.vertices[a];
    out.emplace_back((mesh.vertices[b] - p).cross(mesh.vertices[c] - p).stableNormalized());
  }
  return out;
}

std::vector<Vec3> vertex_normals(const TriangleMesh& mesh) {
  const auto facets = facet_normals(mesh);  // which asks for a valid mesh
  std::vector<Vec3> out(mesh.vertices.size(), Vec3::Zero());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& p = mesh.vertices[mesh.triangles[t][i]];
      const Vec3 u = mesh.vertices[mesh.triangles[t][(i + 1) % 3]] - p;
      const Vec3 v = mesh.vertices[mesh.triangles[t][(i + 2) % 3]] - p;
      out[mesh.triangles[t][i]] += std::atan2(u.cross(v).norm(), u.dot(v)) * facets[t];
    }
  }
  for (Vec3& n : out) {
    n.stableNormalize();
  }
  return out;
}

Target::Target(TriangleMesh mesh)
    : mesh_(without_unused(std::move(mesh))),
      diagonal_(tunica::diagonal(mesh_)),
      tree_(mesh_),
      around_(incidence(mesh_)),
      cover_(tree_, around_),
      facet_normals_(tunica::facet_normals(mesh_)),
      vertex_normals_(tunica::vertex_normals(mesh_)),
      centroids_(tunica::centroids(mesh_)),
      centroid_tree_(centroids_),
      largest_radius_(largest_radius(mesh_, centroids_)) {
  std::vector<std::array<Vec3, 2>> segments;
  for (auto& loop : boundary_loops(mesh_.triangles, cover_.across())) {
    std::vector<Vec3> polyline;
    double extent = 0;
    for (const Index v : loop) {
      polyline.push_back(mesh_.vertices[v]);
      extent = std::max(extent, (polyline.back() - polyline[0]).norm());
    }
    if (extent <= least_extent * diagonal_) {
      ++point_loops_;
      continue;
    }
    boundary_vertices_.push_back(std::move(loop));
    boundary_.push_back(polyline);
    for (std::size_t i = 0; i < polyline.size(); ++i) {
      segments.push_back({polyline[i], polyline[(i + 1) % polyline.size()]});
    }
  }
  if (!segments.empty()) {
    boundary_tree_.emplace(segments_as_triangles(segments));
  }
}

Target::Foot Target::foot(const Vec3& p, const Vec3& on, Index triangle) const {
  const auto& v = mesh_.triangles[triangle];
  const Vec3 weights = barycentric(on, {mesh_.vertices[v[0]], mesh_.vertices[v[1]], mesh_.vertices[v[2]]});
  const Vec3 normal =
      weights[0] * vertex_normals_[v[0]] + weights[1] * vertex_normals_[v[1]] + weights[2] * vertex_normals_[v[2]];
  const bool usable = normal.squaredNorm() > 1e-4;
  return {on, usable ? Vec3(normal.normalized()) : facet_normals_[triangle], facet_normals_[triangle], (p - on).norm()};
}

Target::Foot Target::closest(const Vec3& p) const {
  const auto hit = tree_.closest(p);
  return foot(p, hit.point, hit.triangle);
}

std::optional<Target::Foot> Target::closest_facing(const Vec3& p, const Vec3& direction, double reach) const {
  const auto hit = tree_.closest(p);
  if (hit.squared_distance > reach * reach) {
    return {};
  }
  const auto faces = [&](Index t) { return facet_normals_[t].dot(direction) > 0; };
  if (faces(hit.triangle)) {
    return foot(p, hit.point, hit.triangle);
  }
  double best = reach * reach;
  Vec3 on;
  std::optional<Index> triangle;
  for (const Index t : centroid_tree_.nearest(p, triangles_looked_at, faces, reach + largest_radius_)) {
    const auto& v = mesh_.triangles[t];
    const Vec3 q = closest_point_on_triangle(p, mesh_.vertices[v[0]], mesh_.vertices[v[1]], mesh_.vertices[v[2]]);
    if ((p - q).squaredNorm() <= best) {
      best = (p - q).squaredNorm();
      on = q;
      triangle = t;
    }
  }
  return triangle ? std::optional(foot(p, on, *triangle)) : std::nullopt;
}

std::optional<Vec3> Target::barycentre_of_three(const Vec3& p, const Vec3& direction, double reach) const {
  const auto faces = [&](Index t) { return facet_normals_[t].dot(direction) > 0; };
  const auto nearest = centroid_tree_.nearest(p, 3, faces, reach);
  if (nearest.size() < 3) {
    return {};
  }
  return (centroids_[nearest[0]] + centroids_[nearest[1]] + centroids_[nearest[2]]) / 3;
}

}  // namespace tunica
