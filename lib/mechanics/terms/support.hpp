#pragma once

#include "tunica/mechanics/model/model.hpp"
#include "tunica/mechanics/terms/term.hpp"

#include <span>

namespace tunica {

/// The elastic beds of a model, each a force per area -k u on its triangles, u the displacement from the reference, or
/// its part along the reference normal. The area of a curved triangle stands at its corners, a third at each, so that
/// a stiffness is a matrix per node, and constant. Energy u'Ku / 2.
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
  std::vector<Mat3> stiffness_;  ///< #nodes
};

}  // namespace tunica
