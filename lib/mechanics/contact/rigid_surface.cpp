#include "tunica/mechanics/contact/rigid_surface.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/contact/rigid_shape.hpp"

#include <cmath>
#include <numbers>

namespace tunica {
namespace {

// Of a convex body: points all around, far away, drawn to their nearest points.
TriangleMesh convex_surface(const RigidShape& shape, const Vec3& axis, double far) {
  constexpr int slices = 96;
  constexpr int rings = 48;
  const Vec3 u = axis.unitOrthogonal();
  const Vec3 v = axis.cross(u);
  TriangleMesh surface;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int slice = 0; slice < slices; ++slice) {
      const double height = std::numbers::pi * (real(ring) / rings - 0.5);
      const double turn = 2 * std::numbers::pi * real(slice) / slices;
      const Vec3 away = std::sin(height) * axis + std::cos(height) * (std::cos(turn) * u + std::sin(turn) * v);
      const Vec3 p = shape.position() + far * away;
      const RigidDistance found = shape.at(p);
      surface.vertices.emplace_back(p - found.distance * found.normal);
      if (ring > 0) {
        const auto corner = [&](int r, int s) { return narrow<Index>(r * slices + s % slices); };
        surface.triangles.push_back({corner(ring - 1, slice), corner(ring - 1, slice + 1), corner(ring, slice + 1)});
        surface.triangles.push_back({corner(ring - 1, slice), corner(ring, slice + 1), corner(ring, slice)});
      }
    }
  }
  return surface;
}

}  // namespace

TriangleMesh rigid_surface(const RigidBody& body, double time, const Vec3& near, double reach) {
  RigidShape shape(body);
  shape.set_time(time);
  if (const auto* plane = std::get_if<RigidPlane>(&body.shape)) {
    const Vec3 middle = near - shape.at(near).distance * plane->normal;
    const Vec3 u = reach * plane->normal.unitOrthogonal();
    const Vec3 v = plane->normal.cross(u);
    return {{middle - u - v, middle + u - v, middle + u + v, middle - u + v}, {{0, 1, 2}, {0, 2, 3}}};
  }
  if (const auto* mesh = std::get_if<RigidMesh>(&body.shape)) {
    const RigidBody as_read{body.name, RigidMesh{mesh->surface, {}, {}}, {}, {}};
    const RigidShape before(as_read);
    TriangleMesh surface = mesh->surface;
    for (Vec3& vertex : surface.vertices) {
      vertex = shape.carried(vertex, before);
    }
    return surface;
  }
  const double extent = shape.support(Vec3::UnitX()) + shape.support(-Vec3::UnitX()) + shape.support(Vec3::UnitY()) +
                        shape.support(-Vec3::UnitY()) + shape.support(Vec3::UnitZ()) + shape.support(-Vec3::UnitZ());
  const auto axis = [&](const auto& line) {
    const Vec3 along = line.to.at(time) - line.from.at(time);
    return along.norm() > 0 ? Vec3(along.normalized()) : Vec3(Vec3::UnitZ());
  };
  if (const auto* capsule = std::get_if<RigidCapsule>(&body.shape)) {
    return convex_surface(shape, axis(*capsule), 2 * extent);
  }
  if (const auto* cylinder = std::get_if<RigidCylinder>(&body.shape)) {
    return convex_surface(shape, axis(*cylinder), 2 * extent);
  }
  return convex_surface(shape, Vec3::UnitZ(), 2 * extent);
}

}  // namespace tunica
