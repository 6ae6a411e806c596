#pragma once

#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/distance/cover_bound.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/point_tree.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <optional>

namespace tunica {

/// The surface a shell mesh is to become, with what is asked of it again and again. Queries are thread-safe.
/// Cost: build n log n, about 200 bytes per triangle; a query a few microseconds.
class Target {
public:
  /// Vertices that belong to no triangle are left out. Errors: InputError as require_surface(). Limits: an
  /// oriented manifold; the caller checks.
  explicit Target(TriangleMesh mesh);
  Target(const Target&) = delete;
  Target& operator=(const Target&) = delete;

  [[nodiscard]] const TriangleMesh& mesh() const { return mesh_; }
  [[nodiscard]] double diagonal() const { return diagonal_; }
  [[nodiscard]] const ClosestPoint& tree() const { return tree_; }
  [[nodiscard]] const CoverBound& cover() const { return cover_; }
  [[nodiscard]] const Incidence& around() const { return around_; }
  /// By edge of each triangle (corner k to k + 1): the triangle across.
  [[nodiscard]] const std::vector<std::array<Index, 3>>& across() const { return cover_.across(); }
  [[nodiscard]] const std::vector<Vec3>& facet_normals() const { return facet_normals_; }

  /// A point of the surface and the normals there.
  struct Foot {
    Vec3 point;
    Vec3 normal;        ///< unit, interpolated between the angle-weighted normals of the vertices
    Vec3 facet_normal;  ///< unit
    double distance;    ///< from the point asked for
  };

  [[nodiscard]] Foot closest(const Vec3& p) const;

  /// The closest point where the surface faces the side of `direction` (facet normal · direction > 0): of a thin
  /// organ's two walls the one that is meant. None within `reach` (mm): nothing.
  /// Limits: when the closest point of all is on the wrong wall, only the triangles with the 16 nearest centroids of
  /// those that face the right side are looked at.
  [[nodiscard]] std::optional<Foot> closest_facing(const Vec3& p, const Vec3& direction, double reach) const;

  /// The barycentre of the centroids of the three closest triangles, by distance of their centroids, that face the side
  /// of `direction` and whose centroids are within `reach`. Fewer than three such: nothing.
  /// Source: Comas, Duriez, Cotin 2010, section 3; that they face the right side is added here.
  [[nodiscard]] std::optional<Vec3> barycentre_of_three(const Vec3& p, const Vec3& direction, double reach) const;

  /// The boundary as closed polylines, in the direction of the triangles' edges. A loop that is a point, as of a pole
  /// given as a ring of vertices in one place, is none.
  [[nodiscard]] const std::vector<std::vector<Vec3>>& boundary() const { return boundary_; }
  /// Their vertices.
  [[nodiscard]] const std::vector<std::vector<Index>>& boundary_vertices() const { return boundary_vertices_; }
  /// How many loops are a point, and so left out.
  [[nodiscard]] std::size_t point_loops() const { return point_loops_; }
  /// Their segments, see segments_as_triangles(); nothing without a boundary.
  [[nodiscard]] const std::optional<ClosestPoint>& boundary_tree() const { return boundary_tree_; }

private:
  [[nodiscard]] Foot foot(const Vec3& p, const Vec3& on, Index triangle) const;

  TriangleMesh mesh_;
  double diagonal_;
  ClosestPoint tree_;
  Incidence around_;
  CoverBound cover_;
  std::vector<Vec3> facet_normals_;
  std::vector<Vec3> vertex_normals_;
  std::vector<Vec3> centroids_;
  PointTree centroid_tree_;
  double largest_radius_;  ///< of a corner from its triangle's centroid, mm
  std::vector<std::vector<Vec3>> boundary_;
  std::vector<std::vector<Index>> boundary_vertices_;
  std::size_t point_loops_ = 0;
  std::optional<ClosestPoint> boundary_tree_;
};

/// Unit normal per triangle; zero where it has no area.
std::vector<Vec3> facet_normals(const TriangleMesh& mesh);

/// Unit normal per vertex: mean of its facets' normals, weighted by their angles there; zero where there is none.
/// Source: Thürmer, Wüthrich, "Computing vertex normals from polygonal facets", JGT 3(1), 1998.
std::vector<Vec3> vertex_normals(const TriangleMesh& mesh);

}  // namespace tunica
