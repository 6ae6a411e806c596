// wall: from one face of a wall to its middle, where a shell lies.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// How thick a wall is by its two faces.
struct FaceDistance {
  double mean = 0;  ///< mm, over the area of the one face
  double p5 = 0;    ///< over a twentieth of the area it is less
  double p95 = 0;   ///< and over a twentieth more: corners of lids and crotches say nothing of the wall
};

/// Distance of one face of a wall from the other, at the middles of its triangles. Both have triangles.
/// Cost: a microsecond per triangle. Errors: Interrupted.
FaceDistance distance_of_faces(const TriangleMesh& face, const TriangleMesh& other);

}  // namespace tunica
