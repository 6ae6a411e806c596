#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Boundary edges that lie on one another: the surface looks whole there, and is open.
struct Seams {
  std::size_t edges = 0;                      ///< boundary edges that coincide with others, wholly or in parts
  std::size_t whole_edges = 0;                ///< of these: edges that coincide with another one from end to end
  std::size_t t_junctions = 0;                ///< of these: edges along which the other side has vertices
  Vec3 place = Vec3::Zero();                  ///< mm: the middle of the first of them
  Vec3 t_place = Vec3::Zero();                ///< mm: of the first T-junction
  std::vector<std::array<Index, 2>> meeting;  ///< the triangles that meet there, two by two
};

/// Finds the boundary edges that coincide: along seams of texture, where parts were glued or mirrored, at T-junctions.
/// Ends coincide that are no farther apart than a hundredth of the boundary edges there. An edge coincides with others
/// in parts where these do and lie along it.
/// @param mesh  any triangles with three corners and finite vertices
/// Cost: linear for a closed mesh; n log n in the boundary edges. Errors: Interrupted.
Seams find_seams(const TriangleMesh& mesh);

struct WithoutSeams {
  TriangleMesh mesh;
  std::size_t joined_edges = 0;  ///< Seams::edges
  std::size_t split_edges = 0;   ///< Seams::t_junctions
};

/// Makes one vertex of those that coincide along seams, and splits the long edges of T-junctions at the vertices along
/// them. A vertex moves by no more than find_seams() allows. Vertices that are no longer used stay.
WithoutSeams without_seams(TriangleMesh mesh);

}  // namespace tunica
