#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <optional>

namespace tunica {

/// An axis-aligned box. Of nothing: lower = upper = 0.
struct Box {
  Vec3 lower = Vec3::Zero();
  Vec3 upper = Vec3::Zero();
  [[nodiscard]] double diagonal() const { return (upper - lower).norm(); }
};

/// The box of the vertices that some triangle uses, unpadded.
Box bounding_box(const TriangleMesh& mesh);

/// Length of the bounding box's diagonal, mm: what percentages and relative tolerances refer to.
double diagonal(const TriangleMesh& mesh);

/// Sum of the triangles' areas, mm^2.
double area(const TriangleMesh& mesh);

/// Volume enclosed by a closed mesh, mm^3; positive when the triangles face outward.
/// Limits: of an open mesh it is the volume of the cone from the centre of the bounding box.
double signed_volume(const TriangleMesh& mesh);

/// How round a plane section is: 4 pi area / perimeter^2, 1 for a circle, less for several loops together. None where
/// the plane misses the surface or the section is not closed. The mesh is oriented.
std::optional<double> section_roundness(const TriangleMesh& mesh, const Vec3& point, const Vec3& normal);

/// Area of a triangle, mm^2.
double triangle_area(const Vec3& a, const Vec3& b, const Vec3& c);

/// Length of the longest edge of a triangle of a mesh, mm.
double longest_edge(const TriangleMesh& mesh, Index triangle);

/// The angle at p between the ways to a and b, degrees.
double angle_degrees(const Vec3& p, const Vec3& a, const Vec3& b);

/// Smallest of the three angles, degrees; 0 for a degenerate triangle.
double smallest_angle_degrees(const Vec3& a, const Vec3& b, const Vec3& c);

/// 2 inradius / circumradius: 1 for an equilateral triangle, 0 for a degenerate one.
double radius_ratio(const Vec3& a, const Vec3& b, const Vec3& c);

/// Smallest angle of all triangles, degrees. Of no triangles: 60.
double min_angle_degrees(const TriangleMesh& mesh);

/// Mean of radius_ratio over the triangles. Of no triangles: 1.
double mean_quality(const TriangleMesh& mesh);

}  // namespace tunica
