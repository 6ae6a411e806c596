#pragma once

#include "tunica/shell/patch/curved_surface.hpp"

#include <vector>

namespace tunica {

/// How the normal turns along the surface, by triangle (#F, 1/mm): symmetric, tangential to the facet, positive where
/// the surface bulges along its normals. The one that fits best how the normals turn along the triangle's edges: the
/// corners' normals, or those of the vertices where `mesh` has none of its own (`curved` false: flat facets). Zero
/// where a facet has no area. Errors: InputError as require_valid() of the mesh, its normals included where they are
/// looked at. Source: Rusinkiewicz, "Estimating curvatures and their derivatives on triangle meshes", 3DPVT 2004,
/// section 3.
std::vector<Mat3> shape_operators_of(const ShellMesh& mesh, bool curved);

struct Curvature {
  double largest = 0;  ///< 1/mm, of the principal ones
  double sum = 0;      ///< of both, positive where the surface bulges along its normals
};

/// Curvatures of those shape operators (#F). Errors: as there.
std::vector<Curvature> curvatures_of(const ShellMesh& mesh, bool curved);

}  // namespace tunica
