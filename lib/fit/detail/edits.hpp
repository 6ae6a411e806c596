#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/fit/detail/samples.hpp"

#include <optional>

namespace tunica {

/// What shells must keep while they are edited.
struct FitLimits {
  FacetLimits shape;
  double error = 0;                        ///< mm, of a patch
  double may_miss = negligible_shortfall;  ///< by which the shapes' shortfall may grow
};

/// Some patches in place of others, and at most one node that looks for its place. Nodes and slots are the mesh's; new
/// ones have the numbers that follow.
struct Edit {
  struct Added {
    std::array<Index, 3> nodes, slots;
    Index like;  ///< a removed patch that lies near
  };
  std::vector<Index> removed;
  std::vector<Added> added;
  Index node = no_index;
  int rank = 0;                                      ///< of the node, as FitMesh::rank()
  std::vector<Vec3> starts;                          ///< places to look from: the first that keeps the shape counts
  std::vector<std::pair<Index, Vec3>> normals = {};  ///< of the node: slots and where to start
  std::vector<Index> others = {};                    ///< nodes that move with it
};

/// The same edit with the nodes around it free as well: more can be made good, at some five times the cost.
Edit widened(const FitMesh& mesh, Edit edit);

/// Merging the ends of an edge, splitting it, turning it; moving a node. Nothing: the topology, a boundary or a crease
/// does not allow it.
std::optional<Edit> collapse(const FitMesh& mesh, const FitSamples& samples, Index u, Index v);
std::optional<Edit> flip(const FitMesh& mesh, Index u, Index v);
Edit split(const FitMesh& mesh, Index u, Index v);
Edit move(const FitMesh& mesh, Index node, const Vec3& start);
/// Moving a node inside a smooth part, its normal as it agrees best with the facets there.
Edit flatten(const FitMesh& mesh, Index node, const Vec3& start);

/// An edit tried beside the mesh: the node at its best place.
struct Trial {
  Edit edit;
  FitPiece piece;                   ///< the added patches
  std::vector<Index> nodes, slots;  ///< of the piece: their numbers in the mesh
  double error = 0;                 ///< mm, largest of the added patches; infinite: they would lose their shape
  double error_before = 0;          ///< of the removed ones
  double shortfall = 0;  ///< of the added patches' shapes: angles, lengths, sizes against neighbours, and edges that
                         ///< join two features, between which no node can bend
  double shortfall_before = 0;
};

/// Times a limit: what is as far off does not come within it.
inline constexpr double out_of_reach = 8;

/// Places the node by some steps of least squares; an error that stays far above `limits.error` ends them.
/// Cost: some 0.1 ms per step.
Trial try_edit(const FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, Edit edit);

/// What the shapes of some patches lack, as Trial::shortfall has it.
double shortfall_of(const FitMesh& mesh, const std::vector<Index>& patches, const FacetLimits& limits);

/// Does what was tried; the mesh around it must be the same still.
void apply(FitMesh& mesh, Trial&& trial);

/// Collapses edges, those with the least error first, as long as it stays within the limit and more than `shells`
/// remain. Deterministic, independent of the number of threads. Parallel.
void collapse_edges(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t shells,
                    const Progress& progress);

/// Flips edges where that lessens errors.
void flip_edges(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits);

/// Flips, moves, collapses and splits where shapes fall short, within the error's limit (or what it is).
/// @param most  shells
/// @param above  the shortfall from which patches are mended
/// @param may_collapse  else nodes only move, and edges flip
void mend_shapes(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t most, double above = 0,
                 bool may_collapse = true);

/// Splits the longest edge of patches whose error is above the limit, the worst first, at most `count` of them.
/// @return how many
std::size_t split_worst(FitMesh& mesh, const FitSamples& samples, const FitLimits& limits, std::size_t count);

}  // namespace tunica
