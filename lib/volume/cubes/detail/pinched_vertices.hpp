#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <vector>

namespace tunica {

/// A vertex that lies at a sample, because the sample equals the value of the surface; other crossings of the same
/// sample's edges lie there too.
struct PinchedVertex {
  Index vertex;
  std::size_t sample;  ///< the same number for all vertices at one sample
  Vec3 apart;          ///< a place a little further along the vertex's own edge
};

/// Joins vertices at the same sample by edge collapses that keep the surface a manifold with the same topology, so that
/// the triangles between them disappear; those that cannot be joined are moved apart. The mesh must be a manifold with
/// consistent orientation. Unused vertices are removed, the others keep their order.
/// @param pinched  in increasing order of `vertex`
/// Source: the link condition, Dey, Edelsbrunner, Guha, Nekhayev 1999.
/// Cost: linear in the number of vertices; nothing when there are no pinched ones.
void join_pinched_vertices(TriangleMesh& mesh, const std::vector<PinchedVertex>& pinched);

}  // namespace tunica
