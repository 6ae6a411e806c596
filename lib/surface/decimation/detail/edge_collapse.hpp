#pragma once

#include "tunica/core/lanes.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/surface/decimation/detail/edge_heap.hpp"
#include "tunica/surface/decimation/detail/quadric.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Cost of a collapse that must not be.
inline constexpr double forbidden_cost = infinity;

/// What a collapse may make of the triangles around it, unless they were worse before.
struct ShapeLimits {
  double fold_cosine = -1;  ///< of the angle between neighbours' normals
  double least_height = 0;  ///< height over longest edge
  double good_height = 0;   ///< thinner ones must be worth it
};

/// One step of a decimation: vertex `removed` becomes `kept`, which moves to `position` (of the given mesh's frame).
struct Collapse {
  Index kept;
  Index removed;
  Index triangles_left;  // after it
  Vec3 position;
};

/// Greedy quadric edge collapse on an oriented manifold. Keeps the topology (link condition: Euler number, pieces,
/// loops), the boundary (its vertices stay on the given boundary curve), and the side every triangle faces.
/// Works in a frame of its own in which the mesh has diagonal 1.
class EdgeCollapse {
public:
  enum class Aim { least_error, good_shape, few_collapses };

  /// @param mesh  an oriented manifold, with boundary or without; nothing but is_fit() may be asked of any other
  /// @param aim   good_shape spends error on triangles that are nowhere thin; few_collapses is for when much of the
  ///              mesh stays: few planes have met anywhere, and all count alike
  explicit EdgeCollapse(const TriangleMesh& mesh, Aim aim = Aim::least_error);

  /// Whether the mesh is an oriented manifold of finite extent (why_unfit() names the place where it is not).
  [[nodiscard]] bool is_fit() const { return fit_; }
  [[nodiscard]] bool has_boundary() const { return !curves_.empty(); }

  /// Collapses edges until at most `triangles` are left or none can be collapsed. @return triangles left.
  /// @param in_order  from the first one on, for when it may be the result of few that is wanted; else the early ones
  ///                  of many are done in sweeps over the memory
  std::size_t run(std::size_t triangles, const Progress& progress, bool in_order = false);

  /// What was done, in order.
  [[nodiscard]] const std::vector<Collapse>& history() const { return history_; }

private:
  using HalfEdge = Index;  // 3 t + k: from corner k of triangle t to corner k + 1
  enum class Placement : unsigned char { best, end };
  struct Target {
    Vec3 position;
    double error;            // squared distances, as weighted
    double curve = 0;        // place on the boundary curve
    double length_cost = 0;  // what lets short edges go first
    // What it counts for when shape raises the cost.
    [[nodiscard]] double cost(double factor = 1) const { return factor * error + length_cost; }
  };
  // A boundary loop of the given mesh, as a closed polyline; places on it are segment number + fraction.
  struct Curve {
    std::vector<Vec3> points;
    [[nodiscard]] Vec3 at(double place) const;
  };

  static constexpr Index none = 0xffffffff;
  // What is looked at together lies together.
  struct Vertex {
    Quadric quadric;  // of the planes of the triangles, weighted by area
    double area = 0;  // sum of those weights; zero where costs are not divided by it
    Vec3 position = Vec3::Zero();
    Vec3 facing = Vec3::Zero();  // sum of the given triangles' normals times area that the vertex stands for
    double given_area = 0;       // twice the sum of their areas
    HalfEdge outgoing = none;    // a half-edge from it; at a boundary the one without a twin
    Index curve = none;          // boundary curve
    Index mark = 0;              // stamp of the last link check
    Index triangles = 0;         // around it
  };
  struct Half {
    Index from = 0;
    HalfEdge twin = none;
    Index edge = none;
  };

  static HalfEdge next(HalfEdge h) { return h % 3 == 2 ? h - 2 : h + 1; }
  static HalfEdge previous(HalfEdge h) { return h % 3 == 0 ? h + 2 : h - 1; }
  [[nodiscard]] Index from(HalfEdge h) const { return half_[h].from; }
  [[nodiscard]] Index to(HalfEdge h) const { return half_[next(h)].from; }
  // Calls visit(h) for every half-edge that leaves the vertex, counter-clockwise.
  template <typename Visit>
  void around(Index vertex, const Visit& visit) const {
    const HalfEdge first = vertex_[vertex].outgoing;
    HalfEdge h = first;
    do {
      visit(h);
      h = half_[previous(h)].twin;
    } while (h != none && h != first);
  }
  template <typename Visit>
  void neighbours_of(Index vertex, const Visit& visit) const {
    HalfEdge last = none;
    around(vertex, [&](HalfEdge h) {
      visit(to(h));
      last = h;
    });
    if (half_[previous(last)].twin == none) {
      visit(from(previous(last)));
    }
  }

  [[nodiscard]] bool number_vertices(const TriangleMesh& mesh);
  [[nodiscard]] bool connect(const TriangleMesh& mesh);
  [[nodiscard]] bool has_one_fan_per_vertex() const;
  void find_boundary();
  [[nodiscard]] double wall_weight(double squared_length) const;
  void pin_boundary(HalfEdge triangle);
  void sum_quadrics();
  void fill_heap();
  void sweep(std::size_t triangles, const Progress& progress);
  void evaluate_touched();
  [[nodiscard]] double cost_quantile(double fraction) const;
  void compact();
  bool collapse_cheapest();
  [[nodiscard]] std::optional<Target> target(HalfEdge h, Placement placement) const;
  [[nodiscard]] Target inner_target(const Vertex& u, const Vertex& v) const;
  [[nodiscard]] Lanes inner_costs(const std::array<HalfEdge, lane_count>& edges) const;
  void costs_of(const std::vector<Index>& edges, std::vector<double>& costs) const;
  [[nodiscard]] Target best_on_curve(HalfEdge h, const Quadric& q) const;
  [[nodiscard]] Quadric cost_of(Index u, Index v) const;
  void evaluate(Index edge, Placement placement);
  [[nodiscard]] bool keeps_topology(HalfEdge h);
  [[nodiscard]] double shape_penalty(HalfEdge h, const Vec3& position) const;
  [[nodiscard]] double fan_penalty(Index vertex, Index other, const Vec3& position) const;
  [[nodiscard]] bool is_at_tip(HalfEdge h) const;
  [[nodiscard]] double squared_loss(HalfEdge h, const Vec3& position) const;
  void collapse(HalfEdge h, const Target& target);
  void unlink(HalfEdge spoke, HalfEdge rim);
  void set_outgoing(Index vertex, HalfEdge any);

  Vec3 centre_ = Vec3::Zero();
  double scale_ = 1;
  std::vector<Vertex> vertex_;        // #V of those that a triangle uses
  std::vector<Half> half_;            // #3F
  std::vector<HalfEdge> half_of_;     // #E one half-edge of each edge, none when the edge is gone
  std::vector<Placement> placement_;  // #E
  std::vector<Quadric> wall_;         // #V of the planes on the boundary edges; empty when there is no boundary
  std::vector<double> curve_place_;   // #V
  std::vector<Curve> curves_;
  std::vector<Index> number_, given_;  // of the given mesh's vertices here, and back
  Index stamp_ = 0;
  Aim aim_;
  double pull_;  // how strongly a new vertex is held near the middle of its edge where the quadric is flat
  ShapeLimits limits_;
  std::size_t limits_used_ = 0;
  EdgeHeap heap_;
  std::vector<Index> changed_;  // edges around the last collapse, and their costs
  std::vector<double> changed_cost_;
  std::vector<double> sweep_cost_;     // #E while sweeping: known costs, infinite where an edge cannot collapse
  std::vector<std::uint8_t> touched_;  // #V while sweeping: changed since the last sweep
  std::size_t triangles_ = 0;
  bool fit_ = false;
  std::vector<Collapse> history_;
};

}  // namespace tunica
