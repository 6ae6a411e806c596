#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <span>

/// Where on a body something is held, loaded or carried: which of its nodes these are, what part of its triangles and
/// edges.
namespace tunica {

/// Regions include what lies on their border, to `region_tolerance` of the body's bounding-box diagonal, so that
/// coordinates written with seven digits (float files, decimal text) still meet their plane.
inline constexpr double region_tolerance = 1e-6;

struct AllNodes {};
struct BoundaryNodes {};
struct RigidMotions {};  ///< not nodes: the six rigid motions of each piece; only in a fix
struct BoxNodes {
  Vec3 lower, upper;  ///< mm
};
struct HalfSpaceNodes {
  int axis = 0;
  double at = 0;  ///< mm
  bool below = true;
};
struct SphereNodes {
  Vec3 centre;        ///< mm
  double radius = 0;  ///< mm
};
struct ListedNodes {
  std::vector<Index> nodes;  ///< of the body, in file order
};
struct NearestNode {
  Vec3 point;  ///< mm
};
/// All within this distance of the body that is to carry them; only in an attachment.
struct TouchingNodes {
  double distance = 0;  ///< mm
};
using Selection = std::variant<AllNodes, BoundaryNodes, RigidMotions, BoxNodes, HalfSpaceNodes, SphereNodes,
                               ListedNodes, NearestNode, TouchingNodes>;

/// A body on which nodes are selected. Keeps references to its mesh.
class SelectableBody {
public:
  explicit SelectableBody(const ShellBody& shell);
  explicit SelectableBody(const SolidBody& solid);

  [[nodiscard]] bool solid() const { return solid_; }
  /// The shells, where their curved patches are the body; else nothing, and the facets are.
  [[nodiscard]] const ShellMesh* curved() const { return curved_; }
  [[nodiscard]] const std::vector<Vec3>& vertices() const { return vertices_; }
  /// Of its surface.
  [[nodiscard]] const std::vector<std::array<Index, 3>>& triangles() const { return triangles_; }
  [[nodiscard]] bool used(std::size_t vertex) const { return used_[vertex] != 0; }
  [[nodiscard]] double tolerance() const { return tolerance_; }

  /// Of a shell: the nodes of the boundary edges, in the direction of their triangles; in the order of (smaller,
  /// larger) node.
  [[nodiscard]] const std::vector<std::array<Index, 2>>& boundary_edges() const { return edges_; }
  /// Of a shell the ends of these edges, of a solid the nodes of its surface.
  [[nodiscard]] const std::vector<Index>& boundary_nodes() const { return boundary_; }
  /// Of the nodes in use.
  [[nodiscard]] const Box& box() const { return box_; }

  template <typename Predicate>
  [[nodiscard]] std::vector<Index> nodes_where(const Predicate& inside) const;

private:
  void measure();

  const std::vector<Vec3>& vertices_;
  bool solid_;
  const ShellMesh* curved_ = nullptr;
  std::vector<std::array<Index, 3>> triangles_;
  std::vector<std::array<Index, 2>> edges_;
  std::vector<Index> boundary_;
  std::vector<char> used_;  // by an element: loose vertices carry nothing
  Box box_;
  double tolerance_ = 0;
};

/// The nodes that `where` names, at least one, in increasing order. Errors: InputError that begins with `said_at`:
/// none, or one that does not exist or is listed twice.
std::vector<Index> nodes_of(const SelectableBody& body, const Selection& where, const std::string& said_at);

/// Of each triangle whether all its nodes are among these: 1 or 0.
std::vector<double> whole_triangles(std::span<const std::array<Index, 3>> triangles, const std::vector<Index>& nodes);

/// Of each triangle of the body's surface, curved where shells are, the part of its area that lies in a region; where
/// nodes are named, 1 if all its nodes are. Empty: all of it is meant. Errors: InputError that begins with `said_at`:
/// nothing of it. Cost: 100 ns per triangle, some 10 us where the border of the region cuts a patch.
std::vector<double> shares_of(const SelectableBody& body, const Selection& where, const std::string& said_at);

/// Boundary edges of a shell, and the part of each that is meant.
struct SelectedEdges {
  std::vector<std::array<Index, 2>> edges;
  std::vector<double> shares;
};

/// The boundary edges that lie in a region, or have both ends among nodes that are named. Errors: InputError: none.
SelectedEdges edges_of(const SelectableBody& body, const Selection& where, const std::string& said_at);

/// A loop of boundary edges of a shell.
struct Rim {
  std::vector<Index> nodes;  ///< in increasing order
  Vec3 normal;               ///< unit, of the plane nearest to them
};

/// The rims all of whose nodes are among these, at least one, in the order of their first nodes. Errors: InputError.
std::vector<Rim> rims_within(const SelectableBody& body, const std::vector<Index>& nodes, const std::string& said_at);

/// The nodes of a body within a distance of another body's surface: of a shell, of that face of its wall.
/// @param side  of a shell; carrier_said_at  where it was named
/// Errors: InputError as nodes_of(); as require_fit() for a shell whose patches are none.
std::vector<Index> nodes_touching(const SelectableBody& body, double distance, const ShellBody& carrier,
                                  Attachment::Side side, const std::string& said_at,
                                  const std::string& carrier_said_at);
/// The same of the surface of a solid.
std::vector<Index> nodes_touching(const SelectableBody& body, double distance, const SolidBody& carrier,
                                  const std::string& said_at);

}  // namespace tunica
