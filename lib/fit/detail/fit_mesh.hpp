#pragma once

#include "tunica/shell/distance/boundary_distance.hpp"
#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/shell_mesh.hpp"

#include <vector>

/// lib/fit: a target and a coarse mesh in, shells of least error out. fit.hpp is its face; relax.hpp has the paper's
/// rule beside it.
namespace tunica {

inline constexpr Index no_index = 0xffffffff;

/// A place of a patch and how far it is from where it should be: the point of the patch at `at` ought to move by
/// -distance along `direction`.
struct Residual {
  Vec2 at;
  Vec3 direction;   ///< unit
  double distance;  ///< mm, signed
};

/// A shell and what is known of its distance to the target. A slot is one of the normals of a node: a node has one for
/// each side of the creases that meet there.
struct FitPatch {
  std::array<Index, 3> nodes{no_index, no_index, no_index};
  std::array<Index, 3> slots{};
  std::array<std::array<Index, 2>, 3> across{};  ///< by edge (corner k to k + 1): the neighbour's slots at its two ends
  EdgeBits boundary = 0;
  std::vector<Index> attached;  ///< samples of the target
  std::vector<Index> guesses;   ///< of each sample of the patch: the triangle of the target that was closest
  std::vector<Residual> residuals;
  double error = 0;  ///< mm, largest residual

  [[nodiscard]] bool is_alive() const { return nodes[0] != no_index; }
  /// 0, 1 or 2: where the node stands.
  [[nodiscard]] std::size_t corner_of(Index node) const { return nodes[0] == node ? 0 : nodes[1] == node ? 1 : 2; }
  [[nodiscard]] bool has(Index node) const { return nodes[0] == node || nodes[1] == node || nodes[2] == node; }
  [[nodiscard]] bool is_creased(std::size_t edge) const {
    return across[edge][0] != slots[edge] || across[edge][1] != slots[(edge + 1) % 3];
  }
};

/// Shells whose nodes may move together, a whole mesh or a few around an edit: all that least squares needs.
struct FitPiece {
  Patch kind = Patch::watertight;
  std::vector<Vec3> positions;      ///< #V
  std::vector<std::uint8_t> free;   ///< #V: the node may move and its normals turn
  std::vector<Vec3> normals;        ///< #S unit
  std::vector<Index> node_of_slot;  ///< #S
  std::vector<FitPatch> patches;    ///< #T
  std::vector<Index> points;        ///< samples of the target to attach anew at each measurement; none: they stay

  [[nodiscard]] std::array<Vec3, 3> corners(const FitPatch& p) const {
    return {positions[p.nodes[0]], positions[p.nodes[1]], positions[p.nodes[2]]};
  }
  [[nodiscard]] std::array<Vec3, 3> corner_normals(const FitPatch& p) const {
    return {normals[p.slots[0]], normals[p.slots[1]], normals[p.slots[2]]};
  }
  [[nodiscard]] NormalsAcross normals_across(const FitPatch& p) const;
  [[nodiscard]] CubicPatch surface(const FitPatch& p) const;
  /// Unit normal of the facet; zero without area.
  [[nodiscard]] Vec3 facing(const FitPatch& p) const;
  /// Longest edge of the facet, mm.
  [[nodiscard]] double longest_edge(const FitPatch& p) const;
};

/// What facets keep as far as the target allows.
struct FacetLimits {
  double min_angle = 20;      ///< degrees
  double agreement = 0.3;     ///< N·n of a corner's normal and the facet's: the slope there is below 73 degrees
  double size_ratio = 2.5;    ///< of the longest edges of neighbours
  double longest = infinity;  ///< mm, of an edge
};

/// N·n that corners need: a little above what makes a shell, so that round-off costs none.
inline constexpr double fit_agreement = 1.05 * least_normal_agreement;

/// Shortfall of a patch that is no shell, since a normal lies nearly in its facet: outweighs all other shapes.
inline constexpr double no_shell = 1e9;

/// Part of an error, a shortfall or a count above which what is left is no progress.
inline constexpr double worth_it = 0.985;

/// Shortfall by which a step may worsen a shape: a thousandth of an angle.
inline constexpr double negligible_shortfall = 1e-6;

/// Sum of squares of the parts by which a patch's facet misses its smallest angle, its agreement, its longest edge; 0
/// when it keeps them.
double shape_shortfall(const FitPiece& piece, const FitPatch& patch, const FacetLimits& limits);

/// A shell mesh under edit. Patches that are gone have no nodes; their places are used again.
struct FitMesh : FitPiece {
  std::vector<std::vector<Index>> around;  ///< #V patches around each node; empty: the node is gone
  std::vector<Index> places;               ///< of patches that are gone
  std::size_t alive = 0;                   ///< patches

  /// A normal per corner of `shell` that differs from the node's others makes a slot of its own.
  explicit FitMesh(const ShellMesh& shell);

  /// The patches on an edge, at most two; none: no_index.
  [[nodiscard]] std::array<Index, 2> on_edge(Index u, Index v) const;
  /// Whether an edge is the boundary's or a crease.
  [[nodiscard]] bool is_feature(Index u, Index v) const;
  /// 0: inside a smooth part; 1: on a boundary or crease; 2: where several meet or one ends.
  [[nodiscard]] int rank(Index node) const;
  /// Neighbours of a node, ascending.
  [[nodiscard]] std::vector<Index> ring(Index node) const;
  /// Edges (u < v) in a deterministic order.
  [[nodiscard]] std::vector<std::array<Index, 2>> edges() const;
  /// Of the facets, mm².
  [[nodiscard]] double area() const;
  /// Mean edge of equilateral triangles of the mesh's area and count, mm.
  [[nodiscard]] double mean_edge() const;

  /// The patch at a place gets new nodes and slots; add_patch() finds a place.
  Index add_patch(const std::array<Index, 3>& nodes, const std::array<Index, 3>& slots);
  void remove_patch(Index t);
  /// What the patch has across its edges; to be called where neighbours changed.
  void refresh(Index t);

  /// @param kept  when given, the patch of this mesh that each triangle of the result is
  [[nodiscard]] ShellMesh shell(std::vector<Index>* kept = nullptr) const;
};

}  // namespace tunica
