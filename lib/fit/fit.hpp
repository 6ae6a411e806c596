#pragma once

#include "tunica/fit/relax.hpp"

namespace tunica {

struct FitOptions : RelaxOptions {
  std::optional<std::size_t> shells;  ///< at most this many instead of as many as COARSE has
  double min_angle = 20;  ///< degrees: what angles keep where the target's boundaries and creases allow it; 1 to 30
};

/// The least-error fit: shells whose nodes, normals and connectivity are chosen together so that the curved surface is
/// closest to the target, measured both ways, boundaries as curves too.
///
/// With `tolerance` the fewest shells found whose certified distance holds; with `refine` besides, COARSE's triangles,
/// split where that is needed. With `refine` alone every shell is split in four and refitted (see refit()) as far as
/// `max_shells` or `max_iterations` allow. Else the closest surface found with `shells` (none: as many as COARSE has).
/// One search serves all: least squares on a node, a ring or all nodes; edges collapse in the order of the error that
/// this leaves, flip and split; a certificate, and splits where it finds more. Where these are in vain, the search for
/// a tolerance begins again from triangles that keep half of it.
/// @param coarse  an oriented manifold that faces as the target does; where its topology is not the target's, it is
/// what is fitted; else its triangles count with `refine` only, else only how many they are
/// Keeps: topology, boundary loops, creases of the target (curves, with a normal for each side; all other nodes have
/// one normal, but where facets fold so sharply that no one normal makes shells of them); angles of `min_angle`,
/// neighbours' sizes within 2.5, edges within a quarter of a square of the body's area (to a count and with `refine`:
/// and within twice the mean), and a node inside whatever lies between boundaries and creases, where the target and the
/// tolerance allow it. Deterministic, independent of the number of threads. Errors: Interrupted; InputError: no
/// triangle has an area. Source: Hoppe et al.,
/// Mesh optimization, SIGGRAPH 1993, with cubic patches (Comas, Duriez, Cotin 2010, eq. 1-2) in place of facets. Cost:
/// n log n for the target, then some 10 ms per shell of the result. Limits: a greedy search.
RelaxResult fit(const TriangleMesh& coarse, const Target& target, const FitOptions& options);

/// One level of a hierarchy of meshes for mechanics: every shell is split in four, and the nodes and normals are fitted
/// to the target by least squares. Creases, boundaries and normals per side stay; where facets fold so sharply that no
/// one normal makes shells of them they get creases. Cost: about 0.2 ms per new shell.
/// @param halved  as split_shells()
ShellMesh refit(const ShellMesh& shell, const Target& target, double min_angle = 20,
                std::vector<std::array<Index, 2>>* halved = nullptr);

/// Turns the normals, and only these, so that the curved surface comes closer to the target.
/// @param shell  without corner normals; the others agree with their facets, see take_normals_from()
void fit_normals(const Target& target, ShellMesh& shell);

}  // namespace tunica
