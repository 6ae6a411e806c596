#pragma once

#include "tunica/surface/mesh/tet_mesh.hpp"

#include <string>

namespace tunica {

/// Volume of a tetrahedron, mm^3; negative when it is inside out.
double tet_volume(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);

/// What every function of a mesh relies on: corners that exist, and vertices of tetrahedra at finite places, so near
/// that their squares are numbers, too. Errors: InputError that names the first tetrahedron at fault. Cost: linear.
void require_valid(const TetMesh& mesh);

/// Makes a mesh from anywhere one to compute with: indices in range, positions finite, every tetrahedron with a volume,
/// and that positive: one that is inside out is turned by exchanging its last two corners.
/// @param name  of the file, or whatever the mesh came from: messages begin with it
/// @return how many were turned
/// Errors: InputError with the first tetrahedron (or vertex) that is wrong, its number from 0 and its place: no
/// tetrahedra, a corner that does not exist or is there twice, a position that is not finite, no height within
/// rounding, two on the same side of the face that they share. Cost: n log n.
std::size_t require_sound(TetMesh& mesh, const std::string& name);

/// The faces that belong to one tetrahedron only, counter-clockwise seen from outside; by tetrahedron, then by the
/// corner opposite to the face.
/// Errors: InputError when a face belongs to more than two tetrahedra.
/// Cost: n log n.
/// Limits: a mesh for which require_sound() held.
std::vector<std::array<Index, 3>> boundary_triangles(const TetMesh& mesh);

/// Smallest angle between two faces of a tetrahedron, degrees: 70.5 for a regular one, 0 for one without volume. Of no
/// tetrahedra: 180. Cost: linear.
double smallest_dihedral(const TetMesh& mesh);

}  // namespace tunica
