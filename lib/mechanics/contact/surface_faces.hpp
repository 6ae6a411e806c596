#pragma once

#include "tunica/mechanics/contact/patch_map.hpp"
#include "tunica/mechanics/model/model.hpp"

namespace tunica {

/// The surfaces of all bodies that deform: the triangles of shells, the boundary of solids (outward).
struct Surfaces {
  std::vector<SurfaceFace> faces;
  std::vector<std::size_t> first;  ///< per body, and the end
};

/// Errors: InputError: a face of a solid has more than two tetrahedra.
Surfaces surface_faces(const Model& model);

/// The point of a face nearest to `p`, from a start; it stays within the face.
/// Cost: some ten evaluations. Limits: a local minimum.
Vec2 nearest_on_face(const SurfaceFace& face, const PatchMap& map, const Vec3& p, const Vec2& start);

}  // namespace tunica
