#pragma once

#include "tunica/mechanics/elements/shell_element.hpp"
#include "tunica/mechanics/model/configuration.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <memory>
#include <vector>

/// From the nodes of a triangle to the points of its surface, and by the transpose of the derivative from forces on the
/// points to forces and moments on the nodes: whatever acts is in balance, and does the same work on both sides.
///
/// The surface of a shell is the watertight patch (shell/patch/curved_surface.hpp) of positions and normals that the
/// nodes carry with them, those of the triangles across its edges included, so that neighbours meet and a point depends
/// on its three nodes alone. Its centre follows the edges by the weights of the reference. A flat face (of a solid, or
/// of a shell that touches with its facets) moves with the positions alone.
/// Source: Comas, Duriez, Cotin 2010, section 2 (the shape function spreads contact forces); the transpose: virtual
/// work.
namespace tunica {

struct SurfaceFace {
  std::array<Index, 3> nodes{};  ///< global
  std::size_t body = 0;
  std::size_t part = 0;  ///< of a body that touches itself: the piece that hangs together (own_surface.hpp)
  bool curved = false;
  double half_thickness = 0;  ///< mm
  double young = 0;           ///< MPa
  /// Of the reference, at the corners, and those of the triangles across the edges; of curved faces.
  std::array<Vec3, 3> normals{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  NormalsAcross across = own_normals_across(normals);
  std::array<double, 9> centre{};  ///< weights of corners and edge points in the centre
};

/// Weights of corners and edge points (the order of CubicPatch::control) in a point.
using PatchWeights = Eigen::Matrix<double, 9, 1>;

/// @param b  barycentric coordinates (b2, b3)
PatchWeights patch_weights(const SurfaceFace& face, const Vec2& b);

/// Derivatives of the weights by b2 and by b3.
std::array<PatchWeights, 2> patch_weight_derivatives(const SurfaceFace& face, const Vec2& b);

/// A face in a configuration. Cost: .3 kB; with its derivatives 8 kB.
class PatchMap {
public:
  using Points = Eigen::Matrix<double, 3, 9>;
  using Matrix27 = Eigen::Matrix<double, 27, 27>;

  /// @param reference  positions of all nodes
  PatchMap(const SurfaceFace& face, const std::vector<Vec3>& reference, const Configuration& configuration);

  [[nodiscard]] Vec3 point(const PatchWeights& weights) const { return points_ * weights; }
  [[nodiscard]] const Points& points() const { return points_; }

  /// By weights, counted from the first node in the reference: to the digits of displacements and of the face, not of
  /// positions. Of weights that sum up to zero it is a tangent.
  [[nodiscard]] Vec3 from_origin(const PatchWeights& weights) const { return local_ * weights; }

  /// Makes the derivatives, which the functions below need.
  void linearise();

  /// Changes of corners and edge points by displacements and spins of the nodes (6 per node).
  [[nodiscard]] Points change(const Vector18& of_nodes) const;

  /// Forces and moments of the nodes from forces on corners and edge points.
  [[nodiscard]] Vector18 to_nodes(const Points& forces) const;

  /// d(forces)/d(points) by way of the nodes, and what the curvature of the map adds under these forces.
  [[nodiscard]] Matrix18 stiffness(const Matrix27& of_points, const Points& forces) const;

  /// d (corners and edge points) / d (displacements, spins).
  [[nodiscard]] const Eigen::Matrix<double, 27, 18>& jacobian() const { return linear_->jacobian; }

  /// d point / d (displacements, spins) at weights.
  [[nodiscard]] Eigen::Matrix<double, 3, 18> derivative(const PatchWeights& weights) const;

private:
  /// What an edge point depends on: the edge from its corner, and the normals there.
  struct EdgePoint {
    int here = 0, there = 0;
    Vec3 edge, mean, difference;
  };
  /// An edge point as a function of the edge and the spin of its corner.
  struct LinearEdge : EdgePoint {
    double alpha = 0, beta = 0, gamma = 0;
    Vec3 d_alpha, d_beta, d_gamma;  ///< by s = mean.edge, a = difference.edge, q = edge.edge
    Mat3 dd_alpha, dd_beta, dd_gamma;
    Eigen::Matrix<double, 3, 6> jacobian;

    explicit LinearEdge(const EdgePoint& point);
    [[nodiscard]] Matrix6 curvature(const Vec3& force) const;
  };
  struct Linear {
    std::vector<LinearEdge> edges;
    Eigen::Matrix<double, 27, 18> jacobian;
  };

  [[nodiscard]] EdgePoint edge_point(int k) const;

  const SurfaceFace* face_;
  Points local_;  ///< from the first node in the reference
  Points points_;
  std::array<Eigen::Quaterniond, 3> turns_;
  std::unique_ptr<Linear> linear_;
};

}  // namespace tunica
