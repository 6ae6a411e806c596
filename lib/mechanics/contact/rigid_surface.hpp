#pragma once

#include "tunica/mechanics/model/model.hpp"

namespace tunica {

/// A rigid body at a time as triangles, for pictures: a mesh as it was read, of a plane a square, `reach` to each side,
/// around the point closest to `near`, else some 9,000 triangles. @param time  in a static run the load factor
TriangleMesh rigid_surface(const RigidBody& body, double time, const Vec3& near, double reach);

}  // namespace tunica
