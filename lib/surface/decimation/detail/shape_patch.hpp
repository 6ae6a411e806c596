#pragma once

#include "tunica/surface/decimation/detail/edit_mesh.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/distance/closest_point.hpp"

#include <Eigen/Geometry>

#include <functional>
#include <optional>

namespace tunica {

/// Of the target's diagonal: smaller errors are those of rounding, and nothing is weighed against them.
inline constexpr double negligible_error = 1e-6;

/// What a triangle is charged for. Errors and shapes are weighed against each other by `error` and the two weights.
struct ShapeWeights {
  /// mm: no triangle may get a larger error than this, unless one that it replaces had it.
  double most_error = infinity;
  double error = 1;           ///< mm: what counts as a large error
  int doublings = 2;          ///< the error enters by the power 2^doublings
  double quality = 0.3;       ///< of 1 - radius ratio
  double angle = 30;          ///< of the squared lack of angle, relative to the one wanted
  double angle_wanted = 0;    ///< degrees
  double fold_cosine = -0.5;  ///< neighbours may not fold more sharply, unless they did before
};

/// A local change of a mesh: these triangles go, those come, one vertex moves (or is new).
struct PatchTrial {
  std::vector<Index> removed;
  std::vector<std::array<Index, 3>> corners;  ///< of the new triangles
  Index moved = EditMesh::none;
  Vec3 position = Vec3::Zero();

  // Filled in by the evaluation.
  std::vector<double> error, cost;  ///< of each new triangle
  std::vector<Index> guess;
  double moved_error = 0;             ///< of the vertex that moves
  std::vector<Index> samples, owner;  ///< the target's points of the patch, and the new triangle each belongs to
};

/// Answers which point of the target is closest to p; the triangle named is probably near it. Any point whose squared
/// distance is at most `enough` will do.
using NearestPoint = std::function<ClosestPoint::Hit(const Vec3& p, Index near, double enough)>;

/// Points of the target that a mesh is to be close to.
struct TargetSamples {
  std::vector<Vec3> points;
  std::vector<Index> owner;             ///< the mesh's triangle closest to each
  std::vector<double> squared;          ///< the squared distance to it
  std::vector<Index> near;              ///< #F of the mesh: a triangle of the target near it
  std::vector<std::uint8_t> on_target;  ///< #V of the mesh: is a vertex of the target; empty: not known
};

/// About 40 points for each triangle of the mesh, if the target has as many vertices; with few of them the triangles'
/// centres as well. @param tree over the target
TargetSamples sample_target(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree);

/// A mesh beside its target: how far apart they are, triangle by triangle, both ways by points, and what local changes
/// would make of it. Errors are of points, no bounds: what is made with them is certified afterwards.
class ShapedMesh {
public:
  /// Errors are those of the samples at first: see measure_all(), measure_corners(), measure().
  /// @param target   must live as long
  /// @param nearest  on the target
  ShapedMesh(const TriangleMesh& mesh, const TriangleMesh& target, NearestPoint nearest, TargetSamples samples,
             const BoundaryCurves& curves);

  /// The errors of all triangles: at their centre and corners, in the middle of their edges, and of their samples.
  void measure_all();

  /// The errors of all triangles at their corners and of their samples. @param nearest may be quick and too far
  void measure_corners(const NearestPoint& nearest);

  void set_weights(const ShapeWeights& weights);
  [[nodiscard]] const ShapeWeights& weights() const { return weights_; }
  /// Changes `most_error` alone.
  void limit_error(double most_error) { weights_.most_error = most_error; }

  [[nodiscard]] const EditMesh& mesh() const { return mesh_; }
  [[nodiscard]] double error(Index t) const { return states_[t].error; }
  /// The point of the target that is farthest from triangle t, of those that belong to it.
  [[nodiscard]] std::optional<Vec3> farthest_sample(Index t) const;
  [[nodiscard]] double cost(Index t) const;
  /// Degrees, but for the corner at the pinned vertex where there is one, as long as that has its least angle.
  [[nodiscard]] double smallest_angle(Index t) const;
  [[nodiscard]] const BoundaryCurves::Place& place(Index vertex) const { return places_[vertex]; }

  /// Moves a vertex to where it stays from here on, at a sharp corner of the target's boundary or creases: its angle in
  /// a triangle is not charged for from `least_angle` (degrees) on, since the target leaves no choice. Once
  /// measure_all() is done. @return false where that would fold
  bool pin(Index vertex, const Vec3& position, double least_angle);
  [[nodiscard]] bool is_pinned(Index vertex) const {
    return vertex < least_angle_.size() && least_angle_[vertex] != not_pinned;
  }

  /// Measures a triangle also at its centre and in the middle of its edges. @param nearest may be quick and too far
  void measure_middle(Index t, const NearestPoint& nearest);

  /// Measures a triangle again, also within.
  void measure(Index t);

  /// Measures the new triangles of an evaluated trial also within. @return the largest error
  double measure_within(PatchTrial& trial) const;

  /// Changes to try. Each clears the trial first; false where the topology forbids it.
  void make_move(Index vertex, const Vec3& position, PatchTrial& trial) const;
  [[nodiscard]] bool make_flip(Index u, Index v, PatchTrial& trial) const;
  [[nodiscard]] bool make_collapse(Index u, Index v, PatchTrial& trial) const;
  void make_split(Index u, Index v, PatchTrial& trial) const;
  void make_centre_split(Index t, PatchTrial& trial) const;

  /// What the change costs, less what there is now: infinite where it folds the mesh over or costs more than `limit`.
  double evaluate(PatchTrial& trial, double limit) const;

  /// Does what the trial holds (evaluated last).
  void commit(const PatchTrial& trial);

  /// Where a vertex should go: onto the target by least squares over the points of the triangles around it, sideways
  /// (where that costs nothing) to the middle of its neighbourhood, the stronger the larger `pull`.
  [[nodiscard]] Vec3 proposal(Index vertex, double pull) const;

  /// The same for the moved vertex of an evaluated trial.
  [[nodiscard]] Vec3 proposal(const PatchTrial& trial, double pull) const;

  /// The point of the target closest to a vertex.
  [[nodiscard]] Vec3 foot(Index vertex) const {
    return nearest_(mesh_.positions[vertex], states_[mesh_.around[vertex][0]].guess, exact).point;
  }

  /// A place on the boundary for a boundary vertex: the given fraction of the way between its neighbours there.
  [[nodiscard]] Vec3 slide(Index vertex, double fraction) const;

  /// A point of the target, on its boundary for a boundary edge, halfway between two vertices.
  [[nodiscard]] Vec3 middle(Index u, Index v) const;

private:
  static constexpr double exact = -1;  // no distance is near enough
  static constexpr double unknown = -1;
  static constexpr double not_pinned = -1;
  static constexpr std::array<double, 3> no_middles{unknown, unknown, unknown};
  struct State {
    std::vector<Index> samples;
    double error = 0;
    Index guess = 0;
  };
  struct LeastSquares;

  static Vec3 area_vector(const std::array<Vec3, 3>& c) { return (c[1] - c[0]).cross(c[2] - c[0]); }
  [[nodiscard]] std::array<Vec3, 3> corners(const std::array<Index, 3>& triangle, const PatchTrial& trial) const;
  [[nodiscard]] double smallest_angle(const std::array<Index, 3>& triangle, const std::array<Vec3, 3>& corners) const;
  [[nodiscard]] double shape_cost(const std::array<Index, 3>& triangle, const std::array<Vec3, 3>& corners) const;
  [[nodiscard]] double error_cost(double error) const;
  [[nodiscard]] bool folds(const PatchTrial& trial) const;
  [[nodiscard]] bool faces_away(const std::array<Vec3, 3>& corners, Index guess) const;
  [[nodiscard]] double squared_within(const std::array<Vec3, 3>& corners, Index guess, double squared) const;
  [[nodiscard]] bool assign_samples(PatchTrial& trial, const std::array<Vec3, 3>* corners, double allowed,
                                    double most_error, double& total) const;
  // What was found in the middle of the edge from corner k of t on, from its other side; it may be too much.
  [[nodiscard]] double known_middle(Index t, std::size_t k) const {
    const Index next = mesh_.triangles[t][(k + 1) % 3];
    const Index across = mesh_.on_edge(mesh_.triangles[t][k], next)[1];
    return across == EditMesh::none ? unknown : middle_[across][mesh_.corner_of(across, next)];
  }
  [[nodiscard]] double squared_of_samples(Index t, const std::array<Vec3, 3>& corners) const;
  void find_places();

  EditMesh mesh_;
  const TriangleMesh& target_;
  NearestPoint nearest_;
  const BoundaryCurves& curves_;
  ShapeWeights weights_;
  int parts_;  // of an edge, where a triangle is measured within: about as long as the target's edges
  std::vector<Vec3> sample_;
  std::vector<std::uint8_t> on_target_;  // #V of the mesh as given, see TargetSamples
  std::vector<double> vertex_error_;     // #V distance of each vertex to the target
  std::vector<State> states_;
  std::vector<double> least_angle_;            // #V that a triangle may have there, if it is pinned
  mutable std::vector<double> shape_cost_;     // #T as far as known
  std::vector<std::array<double, 3>> middle_;  // #T squared distances in the middle of each edge, as far as known
  std::vector<BoundaryCurves::Place> places_;
};

}  // namespace tunica
