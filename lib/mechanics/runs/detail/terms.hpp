#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

namespace tunica {

/// The shells, damped, with the pressure that follows them, which is made of the same kinematics.
class ShellTerm : public Term {
public:
  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;
  void add_linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) const override;
  void add_linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) const override;
  [[nodiscard]] double energy(const ShellSystem& system, const Configuration& configuration) const override;
  [[nodiscard]] std::array<double, 2> squared_stiffness(const ShellSystem& system) const override;
};

/// The tetrahedra.
class SolidTerm : public Term {
public:
  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;
  void add_linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) const override;
  void add_linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) const override;
  [[nodiscard]] double energy(const ShellSystem& system, const Configuration& configuration) const override;
  [[nodiscard]] std::array<double, 2> squared_stiffness(const ShellSystem& system) const override;
};

/// Pressure that follows the faces of tetrahedra.
class SolidPressureTerm : public Term {
public:
  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;
};

/// Loads that keep their direction.
class DeadLoadTerm : public Term {
public:
  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;
};

/// Masses that are accelerated, and damping in proportion to them. Masses are lumped; rotary inertia is rho t^3 / 12
/// per area about every axis (that of a plate about the axes in its plane), so it needs no gyroscopic term.
class InertiaTerm : public Term {
public:
  explicit InertiaTerm(const ShellSystem& system);
  bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const override;

private:
  VectorX masses_;
  double noise_;  ///< N s^2, per derivative of the acceleration: what the digits of places leave of it
};

/// Fills `terms`, in the order in which they are summed, and makes the bed. All that they act on is there.
void make_terms(ShellSystem& system);

/// Sums of the squares of a stiffness' entries, by displacements and by the other freedoms of its nodes.
template <typename Stiffness>
void add_squares(const Stiffness& stiffness, Eigen::Index per_node, double length, std::array<double, 2>& sums) {
  for (Eigen::Index row = 0; row < stiffness.rows(); ++row) {
    for (Eigen::Index column = 0; column < stiffness.cols(); ++column) {
      const double entry = stiffness(row, column) / (row % per_node < 3 ? 1 : length);
      sums[column % per_node < 3 ? 0 : 1] += entry * entry;
    }
  }
}

}  // namespace tunica
