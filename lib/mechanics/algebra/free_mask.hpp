#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"

namespace tunica {

/// Axes of its own along which a node's freedoms are counted, where those of the world do not tell what is held.
struct NodeAxes {
  Index node = 0;
  Mat3 axes = Mat3::Identity();  ///< a row each; unit, at right angles
};

/// One entry per freedom (6 per node): whether it is solved for. Held ones stay zero in every solution. Vectors and
/// matrices are along the axes of the world; only the entries of nodes in `own_axes` are along others.
struct FreeMask : std::vector<bool> {
  using std::vector<bool>::vector;

  std::vector<NodeAxes> own_axes;  ///< at most one of a node
};

/// From world axes to the nodes' own, and back.
void to_own_axes(const FreeMask& free, VectorX& v);
void to_world_axes(const FreeMask& free, VectorX& v);
/// Rows and columns. Cost: that of the blocks of these nodes.
void to_own_axes(const FreeMask& free, BlockMatrix& matrix);

/// The entries, all false at nodes with axes of their own.
std::vector<bool> along_world(const FreeMask& free);

/// Sets the held entries to zero. Errors: InputError: marks or numbers that are not as many.
void mask(const FreeMask& free, VectorX& v);

}  // namespace tunica
