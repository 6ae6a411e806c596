#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Which way the pieces of a surface face.
struct Facing {
  std::size_t pieces = 0;
  std::size_t inward = 0;            ///< pieces that face the wrong way: see facing_of()
  std::size_t outermost_inward = 0;  ///< of those the ones that lie within no other
  std::size_t bulging = 0;           ///< open pieces too shallow to have an inside, that bulge away from their normals
  std::size_t hollows = 0;           ///< pieces that lie within others and face into what they enclose
  Vec3 place = Vec3::Zero();         ///< mm: a vertex of the largest piece that faces the wrong way
  Vec3 hollow_place = Vec3::Zero();  ///< mm: of the largest hollow
  std::vector<bool> is_wrong;        ///< #F
};

/// Normals are to point out of the material: outward, and into its hollow from a piece that lies within another, and so
/// on by turns. A closed piece says by its volume which way it faces. An open one has an inside where its points, on
/// the mean, see it in more than two thirds of the directions on one side: tubes from one and a half diameters on, what
/// is closed but for its rims; but no sheet, no half ball and no half pipe, of which only is said that they bulge away
/// from their normals, where the mean winding number is below -1/100. Pieces that meet along seams count as one. How:
/// the mean winding number of the surface at points of its own, half of that of its inside.
/// @param mesh  an oriented manifold
/// Source: Jacobson, Kavan, Sorkine-Hornung, Robust inside-outside segmentation using generalized winding numbers,
/// SIGGRAPH 2013. Cost: linear; a million triangles of an open piece take half a second.
Facing facing_of(const TriangleMesh& mesh);

/// The mesh with the pieces turned that face the wrong way.
TriangleMesh turned_outward(TriangleMesh mesh, const Facing& facing);

}  // namespace tunica
