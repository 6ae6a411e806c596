#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/elements/shell_element.hpp"
#include "tunica/mechanics/model/configuration.hpp"
#include "tunica/mechanics/model/model.hpp"

#include <span>

namespace tunica {

/// The elastic beds of a model, each a force per area -k u on its triangles, u the displacement from the reference, or
/// its part along the reference normal. The area of a curved triangle stands at its corners, a third at each, so that
/// a stiffness is a matrix per node, and constant. Energy u'Ku / 2.
class SupportTerm {
public:
  /// @param elements  of the model's shells, with the areas of their curved patches
  /// @param normals  reference normals at the corners of each element
  SupportTerm(const Model& model, std::span<const ShellElement> elements,
              std::span<const std::array<Vec3, 3>> normals);

  [[nodiscard]] bool empty() const { return stiffness_.empty(); }
  [[nodiscard]] double energy(const std::vector<Vec3>& displacement) const;
  /// Adds the forces K u to `forces` (6 per node).
  void add_forces(const std::vector<Vec3>& displacement, VectorX& forces) const;
  /// Likewise of displacements and rotations, 6 per node.
  void add_forces(const VectorX& displacement, VectorX& forces) const;
  void add_stiffness(BlockMatrix& matrix) const;
  /// Sum of the squares of its entries, (N/mm)^2: for the scale of round-off.
  [[nodiscard]] double squared_norm() const;
  /// N/mm, of a node; zero where no bed is.
  [[nodiscard]] Mat3 at(std::size_t node) const;

private:
  std::vector<Mat3> stiffness_;  ///< empty, or #nodes
};

}  // namespace tunica
