#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/fit/barycentre.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <functional>
#include <optional>
#include <string>

namespace tunica {

/// One iteration: nodes moved, normals chosen, distance measured.
struct RelaxIteration {
  std::size_t shells = 0;
  Interval hausdorff;  ///< mm
  double seconds = 0;
  NodeMoves moves;  ///< by the paper's rule
};

/// Of the diagonal: width of the intervals that are measured.
inline constexpr double default_width = 1e-4;

/// What both ways to put shells on a target need to know: the paper's rule (relax_by_barycentre) and the fit (fit).
struct RelaxOptions {
  Patch surface = Patch::watertight;  ///< what positions and normals are to stand for
  std::optional<double> tolerance;    ///< mm: done when the two-sided distance is certainly at most this
  /// Split where the distance is above the tolerance; without one, everywhere.
  bool refine = false;
  std::optional<std::size_t> max_shells;
  std::optional<int> max_iterations;
  std::optional<double> width;  ///< mm: of the measured intervals; none: 0.01 % of the target's diagonal
  /// Tells how it goes; the mesh is the best one until then.
  std::function<void(const RelaxIteration&, const ShellMesh&)> on_iteration;
  Progress progress;
};

/// Errors: InputError where a number is negative, not finite, or zero and no tolerance.
void require_valid(const RelaxOptions& options);

struct RelaxResult {
  ShellMesh shell;         ///< the best iterate, without unused nodes
  ShellDistance distance;  ///< of its curved surface
  std::vector<RelaxIteration> iterations;
  std::optional<bool> reached;  ///< the tolerance; none without one
  std::string stopped;          ///< why it ended there, in words
};

/// Whether most of a mesh's area faces the other way than the target.
bool faces_other_way(const TriangleMesh& mesh, const Target& target);

/// Turns every triangle around.
TriangleMesh turned_around(TriangleMesh mesh);

/// Moves a coarse mesh onto a target as curved shells by the paper's rule. Per iteration: nodes move to barycentres,
/// folds and thin triangles are mended (mend_shapes()), nodal
/// normals come from the target and are fitted to it, the two-sided distance of the curved surface is measured. It ends
/// when the tolerance certainly holds; when three iterations in a row brought less than 1 % (then it refines, if it
/// may); or at the limits: 20 iterations, 60 where it refines. The best iterate is the result.
/// @param coarse  an oriented manifold that faces as the target does; @param target  likewise
/// Errors: InputError when facets fold so sharply that no normal can serve at a node: it names the node and place.
/// Source: Comas, Duriez, Cotin 2010, section 3.
/// Cost: per iteration about 100 us per shell plus 2 us per target triangle for each step of the normals' fit.
RelaxResult relax_by_barycentre(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options);

/// The distance of a result's curved surface from its target, and of their boundaries: what was proved on the way, and
/// measured again where that is wider than asked for.
/// @param whole  the target as it was given; the result knew it without spikes, `moved` mm from it at most
/// Cost: as shell_distance() where it is measured again, and a mean by samples.
ShellDistance certified_distance(const RelaxResult& relaxed, const Target& whole, double moved,
                                 const ShellDistanceOptions& measuring);

}  // namespace tunica
