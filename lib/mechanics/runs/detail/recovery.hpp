#pragma once

#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include <complex>
#include <span>

namespace tunica {

/// Two symmetric tensors of the shells' planes: xx, yy, xy in the frame of a shell.
struct TensorPair {
  Vec3 force, moment;
};

/// Continuous fields from what shells hold constant: linear within each shell, of least square difference over the area
/// from the shells' values. Continuous at every node among the shells that go on smoothly in each other: not across
/// creases and steps of the thickness, nor between bodies. A tensor is carried from a shell to a node by the smallest
/// rotation of its normal. Means at the nodes of the shells' values lose what a field curves within a star of shells,
/// 5/48 of h^2 times its Laplacian; this undoes it but for 1/48 of the other sign on a regular mesh (in one dimension,
/// for all of it). At a rim, where shells are on one side only, both are of first order: h times the slope by .29 here,
/// by .5 there. Source: Hinton, Campbell 1974, "Local and global smoothing of discontinuous finite element functions
/// using a least squares method"; Oden, Brauchli 1971. Cost: linear; the mass matrix has a condition of 4 over its
/// lumped one, so some fifteen iterations of conjugate gradients.
class Recovery {
public:
  Recovery(const ShellSystem& system);

  /// @param of_elements  #elements
  /// @return #elements: at the corners, in the element's frame
  [[nodiscard]] std::vector<std::array<TensorPair, 3>> at_corners(std::span<const TensorPair> of_elements) const;

  /// mm^2, of an element's facet.
  [[nodiscard]] double area(std::size_t element) const { return area_[element]; }

private:
  using Complex = std::complex<double>;
  struct Corner {
    Index place = 0;  ///< among the continuous field's own nodes
    Complex turn;     ///< by twice the angle from the element's frame to the place's
  };
  using Corners = std::array<Corner, 3>;

  void add_body(const ShellBody& body, std::span<const ShellElement> elements);
  /// @param turns  of a deviator: its phase turns from frame to frame; else the values are scalars
  [[nodiscard]] std::vector<Complex> solved(std::span<const Complex> of_elements, bool turns) const;
  [[nodiscard]] Complex phase(const Corner& corner, bool turns) const { return turns ? corner.turn : Complex(1); }

  std::vector<Corners> corners_;  ///< #elements
  std::vector<double> area_;      ///< #elements
  std::vector<double> lumped_;    ///< #places
};

}  // namespace tunica
