#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/terms/term.hpp"

#include <span>

namespace tunica {

/// The elastic beds of a model, each a force per area on its triangles. In all directions it is -k u, u the
/// displacement from the reference. A bed along the normal lets the wall slide: its energy is k d^2 / 2 per area, d the
/// distance of the moved point from the reference surface, to second order n.u + u'Su / 2 with the normal n and the
/// shape operator S there. Without the second term a round tube that is pressed into its bed would gain by turning
/// about its axis. The area of a curved triangle stands at its corners, a third at each. Limits: d is the distance as
/// long as u is short beside the radii of curvature.
class SupportTerm : public Term {
public:
  /// @param elements  of the model's shells, with the areas of their curved patches
  /// @param normals  reference normals at the corners of each element
  SupportTerm(const Model& model, std::span<const ShellElement> elements, std::span<const std::array<Vec3, 3>> normals);

  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;
  void add_linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) const override;
  void add_linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) const override;
  [[nodiscard]] double energy(const ShellSystem& system, const Configuration& configuration) const override;
  [[nodiscard]] std::array<double, 2> squared_stiffness(const ShellSystem& system) const override;
  [[nodiscard]] bool acts_in_image() const override { return false; }
  /// N/mm, of a node; zero where no bed is.
  [[nodiscard]] Mat3 at(std::size_t node) const;

private:
  /// A corner of a triangle on a bed along the normal.
  struct Sliding {
    Index node;
    double stiffness;  ///< N/mm
    Vec3 normal;
    Mat3 shape;  ///< 1/mm
  };
  [[nodiscard]] static double distance(const Sliding& at, const Vec3& displacement);

  std::vector<double> sticking_;  ///< #nodes, N/mm: of beds in all directions
  std::vector<Sliding> sliding_;
  std::vector<Mat3> stiffness_;  ///< #nodes, of both at the reference
};

}  // namespace tunica
