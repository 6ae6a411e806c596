#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/surface/distance/signed_distance.hpp"

#include <memory>
#include <optional>

namespace tunica {

/// What a rigid body is at a point near it.
struct RigidDistance {
  double distance = 0;  ///< mm, to its surface; negative inside
  Vec3 normal;          ///< unit, away from the body: the distance's gradient
  Mat3 curvature;       ///< second derivative of the distance, 1 / mm
};

/// A rigid body at a time. All shapes but the mesh are convex: their distance is a convex function, so that the plane
/// across `normal` through the body's nearest point has the whole body below it.
class RigidShape {
public:
  explicit RigidShape(const RigidBody& body);

  /// In a static run the load factor is the time.
  void set_time(double time);

  [[nodiscard]] RigidDistance at(const Vec3& p) const;

  /// The largest of normal.x over the body; infinite for a plane that looks elsewhere. Of convex bodies.
  [[nodiscard]] double support(const Vec3& normal) const;
  [[nodiscard]] bool convex() const { return surface_ == nullptr; }

  /// Where the material point of the body at `p` at the time before has gone: what friction is measured against.
  [[nodiscard]] Vec3 carried(const Vec3& p, const RigidShape& before) const;

  /// How much farther than carried() a point of its surface may have moved, mm: what the body grows.
  [[nodiscard]] double growth_since(const RigidShape& before) const;

  /// How much longer than straight the way of a turning body's material point is that was at `p` before, mm.
  [[nodiscard]] double detour_since(const RigidShape& before, const Vec3& p) const;

  [[nodiscard]] bool moves_to(const RigidShape& then) const;

  /// How deep inside the distance still leads out on the right side, mm.
  [[nodiscard]] double deepest() const;

  [[nodiscard]] Vec3 position() const;

  /// Of a mesh, as it is given: its corners, and points along its sharp edges.
  /// @param spacing  mm, of points along an edge at most, but for edges longer than 64 of them. Cost: linear.
  [[nodiscard]] std::vector<Vec3> corners_and_edges(double spacing) const;

  /// Where a point of the mesh is, given as the mesh is given.
  [[nodiscard]] Vec3 of_mesh(const Vec3& p) const { return from_mesh(expanded(p, factor_)); }

  /// Triangles of the mesh, where they are, with a corner box within `reach` (mm, along each axis) of a box.
  [[nodiscard]] std::vector<std::array<Vec3, 3>> triangles_near(const Vec3& lower, const Vec3& upper,
                                                                double reach) const;

  /// Some point of the body; none of a plane.
  [[nodiscard]] std::optional<Vec3> inner_point() const;

  /// The largest curvature of the body over all times, 1 / mm; of a mesh that of its sampling, unknown: 0.
  [[nodiscard]] double largest_curvature() const;

private:
  /// To and from the surface of a mesh, expanded as it is, but neither turned nor moved.
  [[nodiscard]] Vec3 to_mesh(const Vec3& p) const;
  [[nodiscard]] Vec3 from_mesh(const Vec3& p) const;

  void expand(const RigidMesh& mesh);
  [[nodiscard]] Vec3 expanded(const Vec3& x, double factor) const;

  const RigidBody* body_;
  std::shared_ptr<const SignedDistance> surface_;
  Vec3 first_ = Vec3::Zero(), second_ = Vec3::Zero();  ///< centre or ends or point
  double radius_ = 0;
  Vec3 shift_ = Vec3::Zero();
  double angle_ = 0, factor_ = 1;
};

/// All that a body's tables say over time, mm or 1; of numbers the first component.
std::vector<Table<Vec3>> tables_of(const RigidBody& body);

}  // namespace tunica
