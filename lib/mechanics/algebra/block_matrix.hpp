#pragma once

#include "tunica/core/types.hpp"

#include <Eigen/Core>

#include <vector>

namespace tunica {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using VectorX = Eigen::VectorXd;

/// Number of a node's freedom: 0 to 2 displacements along x, y, z, 3 to 5 rotations about them.
constexpr std::size_t freedom(std::size_t node, std::size_t component) { return 6 * node + component; }

/// Where the six of a node begin in a vector; of #nodes, its size.
constexpr Eigen::Index first_freedom(std::size_t node) { return freedom(node, 0); }

/// A square sparse matrix of 6x6 blocks (one row of blocks per node), with a symmetric pattern, rows in order.
/// A block is stored by columns.
struct BlockMatrix {
  std::vector<std::size_t> row_start;                            ///< #nodes + 1
  std::vector<Index> column;                                     ///< #blocks, increasing within a row
  std::vector<std::size_t> transposed;                           ///< #blocks: where block (j, i) is
  std::vector<double, Eigen::aligned_allocator<double>> values;  ///< 36 #blocks

  [[nodiscard]] std::size_t node_count() const { return row_start.size() - 1; }
  [[nodiscard]] Eigen::Map<Matrix6> block(std::size_t k) { return Eigen::Map<Matrix6>(values.data() + 36 * k); }
  [[nodiscard]] Eigen::Map<const Matrix6> block(std::size_t k) const {
    return Eigen::Map<const Matrix6>(values.data() + 36 * k);
  }
  /// Place of block (row, column). Errors: InputError when there is none.
  [[nodiscard]] std::size_t find(Index row, Index column) const;
};

/// The pattern of a mesh: nodes that share a triangle, and every node with itself. Values are zero.
/// Errors: InputError when a triangle names a node that does not exist.
BlockMatrix make_block_matrix(std::size_t nodes, const std::vector<std::array<Index, 3>>& triangles);

/// The pattern with these neighbours of every node, itself included, in order; both ways. Errors: InputError when they
/// are not so.
BlockMatrix make_block_matrix(const std::vector<std::vector<Index>>& neighbours);

/// That a vector has a number for each of the six freedoms of every node. Errors: InputError.
void require_freedoms(std::size_t count, std::size_t nodes);

/// y = A x, in parallel; the same to the bit whatever the number of threads. Errors: InputError: x has another size.
void multiply(const BlockMatrix& matrix, const VectorX& x, VectorX& y);

/// y = B x for one 6x6 block stored by columns.
void multiply_block(const double* block, const double* x, double* y);

/// A = (A + A') / 2.
void symmetrise(BlockMatrix& matrix);

/// Dot product in blocks: the same to the bit whatever the number of threads. Errors: InputError: different sizes.
double dot(const VectorX& a, const VectorX& b);

}  // namespace tunica
