#pragma once

#include "tunica/mechanics/model/model.hpp"

#include <string>

/// How sentences name what they are about.
namespace tunica {

/// A thing, after the place in the scene where it was said, if it was.
std::string named(const std::string& said_at, const std::string& name);

/// A body, likewise. Errors: InputError: there is no such body.
std::string label_of(const Model& model, std::size_t body);

/// A point, mm.
std::string where(const Vec3& p);

}  // namespace tunica
