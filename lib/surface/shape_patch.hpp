#pragma once

#include "surface/boundary_curves.hpp"
#include "surface/closest_point.hpp"
#include "surface/edit_mesh.hpp"

namespace tunica {

/// What a triangle is charged for. Errors and shapes are weighed against each other by `error` and the two weights.
struct ShapeWeights {
  /// mm: no triangle may get a larger error than this, unless one that it replaces had it.
  double most_error = std::numeric_limits<double>::infinity();
  double error = 1;         ///< mm: what counts as a large error; it enters by its fourth power
  double quality = 0.3;     ///< of 1 - radius ratio
  double angle = 30;        ///< of the squared lack of angle, relative to the one wanted
  double angle_wanted = 0;  ///< degrees
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
  std::vector<Index> samples, owner;  ///< the target's points of the patch, and the new triangle each belongs to
};

/// A mesh beside its target: how far apart they are, triangle by triangle, both ways by points, and what local changes
/// would make of it. Errors are of points, no bounds: what is made with them is certified afterwards.
class ShapedMesh {
public:
  /// @param target  of the tree; must live as long
  ShapedMesh(const TriangleMesh& mesh, const TriangleMesh& target, const ClosestPoint& tree,
             const BoundaryCurves& curves);

  void set_weights(const ShapeWeights& weights);
  [[nodiscard]] const ShapeWeights& weights() const { return weights_; }

  [[nodiscard]] const EditMesh& mesh() const { return mesh_; }
  [[nodiscard]] double error(Index t) const { return states_[t].error; }
  [[nodiscard]] double cost(Index t) const { return states_[t].cost; }
  [[nodiscard]] double smallest_angle(Index t) const;
  [[nodiscard]] const BoundaryCurves::Place& place(Index vertex) const { return places_[vertex]; }

  /// Changes to try. Each clears the trial first; false where the topology forbids it.
  void make_move(Index vertex, const Vec3& position, PatchTrial& trial) const;
  [[nodiscard]] bool make_flip(Index u, Index v, PatchTrial& trial) const;
  [[nodiscard]] bool make_collapse(Index u, Index v, PatchTrial& trial) const;
  void make_split(Index u, Index v, PatchTrial& trial) const;

  /// What the change costs, less what there is now: infinite where it folds the mesh over or costs more than `limit`.
  double evaluate(PatchTrial& trial, double limit) const;

  /// Does what the trial holds (evaluated last).
  void commit(const PatchTrial& trial);

  /// Where a vertex should go: onto the target by least squares over the points of the triangles around it, sideways
  /// (where that costs nothing) to the middle of its neighbourhood, the stronger the larger `pull`.
  [[nodiscard]] Vec3 proposal(Index vertex, double pull) const;

  /// The same for the moved vertex of an evaluated trial.
  [[nodiscard]] Vec3 proposal(const PatchTrial& trial, double pull) const;

  /// A place on the boundary for a boundary vertex: the given fraction of the way between its neighbours there.
  [[nodiscard]] Vec3 slide(Index vertex, double fraction) const;

  /// A point of the target, on its boundary for a boundary edge, halfway between two vertices.
  [[nodiscard]] Vec3 middle(Index u, Index v) const;

private:
  struct State {
    std::vector<Index> samples;
    double error = 0;
    double cost = 0;
    Index guess = 0;
  };
  struct LeastSquares;

  [[nodiscard]] std::array<Vec3, 3> corners(const std::array<Index, 3>& triangle, const PatchTrial& trial) const;
  [[nodiscard]] double shape_cost(const std::array<Vec3, 3>& corners) const;
  [[nodiscard]] double error_cost(double error) const;
  [[nodiscard]] bool folds(const PatchTrial& trial) const;
  [[nodiscard]] double distance_to_target(const std::array<Vec3, 3>& corners, Index& guess, bool& faces_away) const;
  void refresh(Index t);
  void attach_samples(const TriangleMesh& mesh);
  void find_places();

  EditMesh mesh_;
  const ClosestPoint& tree_;
  const BoundaryCurves& curves_;
  ShapeWeights weights_;
  std::vector<Vec3> sample_;
  std::vector<Vec3> target_normal_;  // #F of the target, unit
  std::vector<State> states_;
  std::vector<BoundaryCurves::Place> places_;
};

}  // namespace tunica
