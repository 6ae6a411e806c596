#pragma once

#include "shell/curved_surface.hpp"
#include "shell/shell_mesh.hpp"

namespace tunica {

/// Flat triangles that stand for some of the patches of a shell mesh; level^2 of each patch, in the order of `chosen`.
struct FlatPieces {
  TriangleMesh mesh;
  std::vector<double> deviation;  ///< #F mm: from a triangle's points to the curved surface, and the reverse
};

/// @param across  neighbours of the shells, see incidence.hpp; chosen  shells
/// @param joined  neighbours share vertices: on their edge points midway between their two curves, which `deviation`
///                pays for; without, patches share no vertices
/// @param gap     mm: curves farther from the middle than this are not joined
FlatPieces flat_pieces(const ShellMesh& shell, const std::vector<CubicPatch>& patches,
                       const std::vector<std::array<Index, 3>>& across, const std::vector<Index>& chosen, int level,
                       double gap, bool joined);

}  // namespace tunica
