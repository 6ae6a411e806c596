#pragma once

#include "core/progress.hpp"
#include "shell/barycentre.hpp"
#include "shell/normals.hpp"
#include "shell/shell_distance.hpp"
#include "shell/shell_mesh.hpp"
#include "shell/target.hpp"

#include <functional>
#include <optional>
#include <string>

namespace tunica {

/// How the nodes are moved.
enum class RelaxMethod {
  barycentre,  ///< the paper's rule
  fit,         ///< the least-error fit, see fit.hpp; normals and measuring are its own
};

/// One iteration: nodes moved, normals chosen, distance measured.
struct RelaxIteration {
  std::size_t shells = 0;
  Interval hausdorff;  ///< mm
  double seconds = 0;
  NodeMoves moves;
};

struct RelaxOptions {
  RelaxMethod method = RelaxMethod::barycentre;
  Patch surface = Patch::comas;  ///< what positions and normals are to stand for
  /// For fit to a tolerance of a target in one piece: watertight ones as well, where shells are long and fewer do.
  bool either_surface = false;
  std::optional<double> tolerance;  ///< mm: done when the two-sided distance is certainly at most this
  /// Split where the distance is above the tolerance; without one, everywhere. For fit: keep COARSE's triangles.
  bool refine = false;
  std::optional<std::size_t> max_shells;  ///< for refine and fit
  std::optional<std::size_t> shells;      ///< for fit: at most this many instead of as many as COARSE has
  /// Degrees by which the normals of comas shells that meet at a node may part where that saves shells, for fit to a
  /// tolerance: 0 where only creases may have several; by more than 45 only where many nodes make use of that. Where
  /// facets turn so far that no single normal serves them all, or a patch is far closer with its own, they part all the
  /// same.
  double kink = 75;
  /// For fit to a tolerance: how long fewer shells are looked for, times the usual (see condense_parted() and, of up to
  /// 600 shells, or with more than 1 of any number, exchange_pieces()). 0: by neither.
  double effort = 1;
  /// Degrees: what the angles of fit's shells keep where the target's folds, rims and creases allow it. None: 20; to a
  /// tolerance 10 or 5 where plain decimation makes needles, as along cylinders, and that saves a quarter of the
  /// shells. From 1 to 30.
  std::optional<double> min_angle;
  std::optional<int> max_iterations;  ///< none: 20, with refine 60; fit: 8 rounds, see fit(), and as many of exchanges
                                      ///< as these take
  std::optional<double> width;        ///< mm: of the measured intervals; none: 0.01 % of the target's diagonal
  /// Tells how it goes; the mesh is the best one until then.
  std::function<void(const RelaxIteration&, const ShellMesh&)> on_iteration;
  Progress progress;
};

struct RelaxResult {
  ShellMesh shell;         ///< the best iterate, without unused nodes
  ShellDistance distance;  ///< of its curved surface
  std::vector<RelaxIteration> iterations;
  std::optional<bool> reached;  ///< the tolerance; none without one
  std::string stopped;          ///< why it ended there, in words
  std::size_t flips = 0;        ///< edges turned for triangles that stand upright, fold or are thin
  std::size_t merged = 0;       ///< pairs of nodes, for the same
  bool turned_around = false;   ///< all triangles of COARSE faced the other way than the target's
};

/// Moves a coarse mesh onto a target as curved shells. Per iteration: the method's move of the nodes, edges turned
/// where a triangle stands upright on the target, folds and thin triangles mended (see mend.hpp), nodal normals from
/// the target and fitted to it, the two-sided distance of the curved surface. It ends when the tolerance certainly
/// holds; when three iterations in a row brought less than 1 % (then it refines, if it may); or at the limits. The best
/// iterate is the result.
/// @param coarse  an oriented manifold; @param target  likewise
/// Errors: InputError when facets fold so sharply that no normal can serve at a node: it names the node and place.
/// Source: Comas, Duriez, Cotin 2010, section 3.
/// Cost: per iteration about 100 us per shell plus 2 us per target triangle for each step of the normals' fit.
RelaxResult relax(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options);

}  // namespace tunica
