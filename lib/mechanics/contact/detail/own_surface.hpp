#pragma once

#include "tunica/mechanics/contact/surface_faces.hpp"

#include <algorithm>
#include <utility>
#include <vector>

/// What hangs together of one body that touches itself. For the files of ContactSystem alone.
namespace tunica {

/// Gives every face of a body the number of the piece that it belongs to: triangles that share a node or meet along a
/// seam (find_seams()), of a solid tetrahedra that share a node.
/// Cost: linear, of a shell n log n in the boundary edges.
void number_parts(const Model& model, std::size_t body, Surfaces& surfaces);

/// Whether two faces belong to one piece of one body. Pieces that do not hang together are as two bodies.
inline bool hang_together(const SurfaceFace& a, const SurfaceFace& b) { return a.body == b.body && a.part == b.part; }

/// Whether two faces have a node in common.
inline bool share_a_node(const SurfaceFace& a, const SurfaceFace& b) {
  return std::ranges::find_first_of(a.nodes, b.nodes) != a.nodes.end();
}

/// How far it is along the edges of a shell, and across its seams.
class SurfacePaths {
public:
  SurfacePaths(const Model& model, std::size_t shell);

  /// Whether some path between the nodes of two faces is no longer than `reach`, mm.
  /// Cost: n log n in the nodes within reach.
  [[nodiscard]] bool connect(const SurfaceFace& from, const SurfaceFace& to, double reach) const;

private:
  void link(Index i, Index j, double length);

  Index first_;                                              ///< node of the shell
  std::vector<std::vector<std::pair<Index, double>>> ways_;  ///< from each node, to which, mm
};

}  // namespace tunica
