// surface/repair: oriented manifolds of any triangles.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// What repaired() did.
struct Repairs {
  std::size_t dropped_triangles = 0;  ///< corners twice or not finite, there already, or in a piece without area
  std::size_t joined_edges = 0;       ///< of the boundary that coincided with others
  std::size_t split_edges = 0;        ///< of these: at T-junctions, split at the vertices along them
  std::size_t turned_triangles = 0;   ///< faced the other way than most of their piece
  std::size_t opened_edges = 0;       ///< are boundary now: too many triangles met there, or they could not agree
  std::size_t split_vertices = 0;     ///< copies made where parts only touched
  std::size_t cut_edges = 0;          ///< got a vertex in the middle, so that two edges have not the same ends

  [[nodiscard]] bool none() const {
    return dropped_triangles + joined_edges + turned_triangles + opened_edges + split_vertices + cut_edges == 0;
  }
};

struct Repaired {
  TriangleMesh mesh;
  Repairs repairs;
};

/// Makes an oriented manifold (see why_unfit) of any triangles, as the same set of points in space: what is there twice
/// goes, boundary edges that coincide are joined (see find_seams()), triangles are turned to agree with their
/// neighbours, where three or more meet at an edge the two that continue each other most smoothly stay joined and so
/// on, and what then only touches gets vertices of its own. Pieces of nothing but degenerate triangles (see
/// is_degenerate) go; others keep theirs, see without_degenerate_triangles(). Holes stay open, pieces that cross go on
/// crossing. An oriented manifold with area everywhere and without such seams comes back as it is. Errors: InputError
/// when a corner does not exist, or no triangle is left. Cost: n log n.
Repaired repaired(const TriangleMesh& mesh);

}  // namespace tunica
