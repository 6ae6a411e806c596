#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <string>

/// How sentences name what they are about.
namespace tunica {

/// A thing, after the place in the scene where it was said, if it was.
std::string named(const std::string& said_at, const std::string& name);

/// A point, mm.
std::string where(const Vec3& p);

}  // namespace tunica
