#pragma once

#include "shell/boundary_distance.hpp"
#include "shell/curved_surface.hpp"
#include "shell/shell_mesh.hpp"
#include "surface/incidence.hpp"

#include <algorithm>
#include <optional>
#include <span>

namespace tunica {

inline constexpr Index no_index = 0xffffffff;

/// A shell mesh under edit: triangles vanish and appear, nodes move, and a node may carry several normals ("slots"):
/// one or more for each side ("sector") of the creases that meet there. Triangles that are gone have no_index corners;
/// their places are used again.
struct FitMesh {
  std::vector<Vec3> positions;                  ///< #V
  std::vector<Vec3> normals;                    ///< #S unit, one per slot
  std::vector<Index> sectors;                   ///< #S numbers, per node, of the sides of creases that meet there
  std::vector<std::array<Index, 3>> triangles;  ///< #T nodes
  std::vector<std::array<Index, 3>> slots;      ///< #T slot of each corner; a slot belongs to one node
  std::vector<std::vector<Index>> around;       ///< #V triangles around each node; empty: the node is gone
  std::vector<std::uint8_t> on_boundary;        ///< #V
  std::vector<std::uint8_t> held;               ///< #V or shorter (then not): the node stays where it is, see FitRegion
  std::vector<Index> free_triangles;
  std::size_t alive = 0;  ///< triangles
  Patch kind = Patch::comas;

  /// One slot per node, with `normals` #V.
  FitMesh(const TriangleMesh& mesh, const std::vector<Vec3>& node_normals);

  [[nodiscard]] bool is_alive(Index t) const { return triangles[t][0] != no_index; }
  [[nodiscard]] bool is_held(Index node) const { return node < held.size() && held[node] != 0; }
  [[nodiscard]] std::array<Vec3, 3> corners(Index t) const {
    const auto& v = triangles[t];
    return {positions[v[0]], positions[v[1]], positions[v[2]]};
  }
  [[nodiscard]] std::array<Vec3, 3> corner_normals(Index t) const {
    const auto& s = slots[t];
    return {normals[s[0]], normals[s[1]], normals[s[2]]};
  }
  [[nodiscard]] CubicPatch patch(Index t) const;

  /// For the edges of a triangle (corner k to k + 1): the slots that the triangle across has at the edge's start and
  /// end; its own where there is none.
  [[nodiscard]] std::array<std::array<Index, 2>, 3> slots_across(Index t) const;

  /// The normals across that make edges of a watertight patch creases; nothing where all edges are smooth.
  [[nodiscard]] std::optional<NormalsAcross> creases(Index t) const;

  /// An edge at the rim of a piece, and the normals that the triangle beyond has at its ends.
  struct RimEdge {
    std::array<Index, 2> nodes;
    std::array<Vec3, 2> normals;
  };
  std::vector<RimEdge> rim;  ///< the creases there

  /// An edge at the rim of a piece beyond which there is a further triangle: no boundary.
  struct CutEdge {
    std::array<Index, 2> nodes;                 ///< ascending
    std::optional<std::array<Vec3, 3>> points;  ///< of the patch beyond, at 1/4, 1/2, 3/4 of the way: not to gape at
  };
  std::vector<CutEdge> cut;  ///< ascending

  [[nodiscard]] bool is_cut(Index u, Index v) const { return cut_edge(u, v) != nullptr; }

  /// The points of the patch beyond a cut edge, from u to v; none where there are none, or the edge is not cut.
  [[nodiscard]] std::optional<std::array<Vec3, 3>> points_beyond(Index u, Index v) const;

  [[nodiscard]] bool is_boundary_edge(Index u, Index v) const;
  [[nodiscard]] EdgeBits boundary_edges(Index t) const;

  struct BoundaryEdge {
    Index triangle;
    CubicCurve curve;
  };
  /// All boundary edges.
  [[nodiscard]] std::vector<BoundaryEdge> boundary() const;

  /// 0, 1 or 2: where in triangle t the node stands.
  [[nodiscard]] std::size_t corner_of(Index t, Index node) const {
    const auto& v = triangles[t];
    return v[0] == node ? 0 : v[1] == node ? 1 : 2;
  }
  [[nodiscard]] bool has_node(Index t, Index node) const {
    const auto& v = triangles[t];
    return v[0] == node || v[1] == node || v[2] == node;
  }

  /// Up to two triangles on an edge (three or more never happen).
  struct Pair {
    std::array<Index, 2> triangle{no_index, no_index};
    [[nodiscard]] std::size_t count() const { return triangle[1] != no_index ? 2 : triangle[0] != no_index ? 1 : 0; }
  };
  [[nodiscard]] Pair on_edge(Index u, Index v) const;

  /// Neighbours of a node, each once, ascending.
  void ring(Index node, std::vector<Index>& out) const;

  /// The slots in use at a node, each once, ascending.
  void slots_of(Index node, std::vector<Index>& out) const;

  /// One more normal. @return its slot
  Index add_slot(const Vec3& normal, Index sector);

  /// A number that no sector at the node has.
  [[nodiscard]] Index fresh_sector(Index node) const;

  Index add_triangle(const std::array<Index, 3>& nodes, const std::array<Index, 3>& corner_slots);
  void remove_triangle(Index t);

  /// Edges (u < v) in a deterministic order.
  [[nodiscard]] std::vector<std::array<Index, 2>> edges() const;

  /// @param kept  when given, the triangle of this mesh that each triangle of the result is
  [[nodiscard]] ShellMesh shell(std::vector<Index>* kept = nullptr) const;

private:
  [[nodiscard]] const CutEdge* cut_edge(Index u, Index v) const;
};

}  // namespace tunica
