#pragma once

#include "shell/relax.hpp"

namespace tunica {

/// The least-error fit: positions, normals and connectivity are chosen together so that the curved surface is closest
/// to the target, measured both ways, gaps between patches included.
///
/// It starts from a quadric decimation of the target, which keeps thin branches and rims (from COARSE where its
/// topology differs from the target's: then COARSE's is meant). Then in turn: edges collapse, cheapest first by the
/// curved error that their placed node would have; edges turn; all nodes and normals move at once by Gauss-Newton on
/// powers of the residuals; patches that are too far off are split; nodes slide where
/// angles are small. Last, mergers that no single node makes good are tried with all nodes together (fit_squeeze.hpp;
/// of many shells fit_condense.hpp), and small pieces are changed and fitted by themselves (fit_exchange.hpp). What
/// stands in for a dense target (fit_start.hpp) is fitted in its place. Where the target has a sharp crease,
/// shells carry a normal per corner; to a tolerance also where that saves shells (RelaxOptions::kink). A certified
/// distance ends it.
///
/// With `tolerance` the fewest shells found whose certified distance holds, or with `refine` COARSE's triangles, placed
/// anew and split where that is needed; without, the least distance found with at most `shells` (none: as many as
/// COARSE has, with `refine` four times as many; more where the topology needs more). Never more shells, or a larger
/// distance, than plain decimation, or with `min_angle` one that keeps it: where that wins, its flat facets are the
/// result (flat shells: corner normals are the facets'). To a tolerance each piece of the target may be flat by itself,
/// crumbs without being tried. Searches that cost little (to a tolerance from few triangles, to few shells) or are
/// uncertain (to a count on a rough target) run from several starts, of which the best is kept. To a tolerance, shells
/// that cross are parted where the target's own triangles do not cross.
/// @param coarse  an oriented manifold; its count, and its topology, may matter; @param target  likewise
/// Keeps: topology of the start, boundary loops. Where COARSE has the target's topology a tolerance holds, certified,
/// for the boundaries as curves too (ShellDistance::boundary; else they are only where the shells end). Angles are at
/// least 20 degrees (RelaxOptions::min_angle) but where folds, rims or creases of the target would cost the tolerance
/// (or, to a count, error), or, unless asked for, ten shells per thin one. Deterministic, independent of the number of
/// threads. Errors: Interrupted. Source: error-driven collapse as in Hoppe et al., Mesh optimization, SIGGRAPH 1993,
/// with cubic patches (Comas, Duriez, Cotin 2010, eq. 1-2) in place of facets. Cost: n log n for the target, then about
/// 1 ms per shell of the result to a count of 400 or more of a smooth target (one round unless `max_iterations` allows
/// more), some 10 ms to other counts and where the target is rough, and to a tolerance up to 0.2 s per shell of few
/// (four searches, pieces fitted anew), 20 ms of many. Limits: a greedy search; where its facets, not its shape, decide
/// (a target hardly denser than the shells needed) plain decimation is the answer.
RelaxResult fit(const TriangleMesh& coarse, const Target& target, const RelaxOptions& options);

}  // namespace tunica
