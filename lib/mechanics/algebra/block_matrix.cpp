#include "tunica/mechanics/algebra/block_matrix.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <functional>

namespace tunica {

std::size_t BlockMatrix::find(Index row, Index wanted) const {
  const auto missing = [&] {
    return InputError(fmt::format("block ({}, {}) is not in the pattern of the matrix", row, wanted));
  };
  if (row >= node_count()) {
    throw missing();
  }
  const auto begin = column.begin() + row_start[row];
  const auto end = column.begin() + row_start[row + 1];
  const auto place = std::lower_bound(begin, end, wanted);
  if (place == end || *place != wanted) {
    throw missing();
  }
  return place - column.begin();
}

BlockMatrix make_block_matrix(std::size_t nodes, const std::vector<std::array<Index, 3>>& triangles) {
  require_corners(nodes, triangles);
  std::vector<std::uint64_t> pairs;
  pairs.reserve(nodes + 6 * triangles.size());
  const auto pair = [](Index row, Index column) { return (std::uint64_t{row} << 32) | column; };
  for (std::size_t i = 0; i < nodes; ++i) {
    pairs.push_back(pair(narrow<Index>(i), narrow<Index>(i)));
  }
  for (const auto& t : triangles) {
    for (const Index i : t) {
      for (const Index j : t) {
        if (i != j) {
          pairs.push_back(pair(i, j));
        }
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  std::vector<std::vector<Index>> neighbours(nodes);
  for (const std::uint64_t p : pairs) {
    neighbours[p >> 32].push_back(static_cast<Index>(p));
  }
  return make_block_matrix(neighbours);
}

BlockMatrix make_block_matrix(const std::vector<std::vector<Index>>& neighbours) {
  const std::size_t nodes = neighbours.size();
  for (std::size_t i = 0; i < nodes; ++i) {
    if (!std::ranges::is_sorted(neighbours[i], std::less_equal<>{}) ||
        (!neighbours[i].empty() && neighbours[i].back() >= nodes)) {
      throw InputError(fmt::format("the neighbours of node {} are not in order, or beyond the {} nodes", i, nodes));
    }
  }
  BlockMatrix matrix;
  matrix.row_start.assign(nodes + 1, 0);
  for (std::size_t i = 0; i < nodes; ++i) {
    matrix.row_start[i + 1] = matrix.row_start[i] + neighbours[i].size();
    matrix.column.insert(matrix.column.end(), neighbours[i].begin(), neighbours[i].end());
  }
  matrix.transposed.resize(matrix.column.size());
  for (std::size_t i = 0; i < nodes; ++i) {
    for (std::size_t k = matrix.row_start[i]; k < matrix.row_start[i + 1]; ++k) {
      matrix.transposed[k] = matrix.find(matrix.column[k], narrow<Index>(i));
    }
  }
  matrix.values.assign(36 * matrix.column.size(), 0);
  return matrix;
}

namespace {

/// Four numbers that one instruction works on, where the machine has such.
using Four = double __attribute__((vector_size(32)));

/// Sum of products of 6x6 blocks with six numbers. Two columns of a block are twelve numbers, three times four: rows
/// 0-3 of the even column, rows 4-5 of it and 0-1 of the odd one, rows 2-5 of the odd one. Each of the nine parts of a
/// block has its own sum, so that no product waits for the one before.
struct BlockSum {
  Four sums[3][3] = {};

  void add(const double* block, const double* x) {
    for (int pair = 0; pair < 3; ++pair) {
      const double even = x[2 * pair];
      const double odd = x[2 * pair + 1];
      const Four factors[3] = {{even, even, even, even}, {even, even, odd, odd}, {odd, odd, odd, odd}};
      for (int part = 0; part < 3; ++part) {
        Four values;
        std::memcpy(&values, block + 12 * pair + 4 * part, sizeof values);
        sums[pair][part] += values * factors[part];
      }
    }
  }

  void store(double* y) const {
    Four total[3];
    for (int part = 0; part < 3; ++part) {
      total[part] = sums[0][part] + sums[1][part] + sums[2][part];
    }
    y[0] = total[0][0] + total[1][2];
    y[1] = total[0][1] + total[1][3];
    y[2] = total[0][2] + total[2][0];
    y[3] = total[0][3] + total[2][1];
    y[4] = total[1][0] + total[2][2];
    y[5] = total[1][1] + total[2][3];
  }
};

}  // namespace

void multiply_block(const double* block, const double* x, double* y) {
  BlockSum sum;
  sum.add(block, x);
  sum.store(y);
}

void require_freedoms(std::size_t count, std::size_t nodes) {
  if (count != freedom(nodes, 0)) {
    throw InputError(fmt::format("{} numbers for the {} freedoms of a matrix", count, freedom(nodes, 0)));
  }
}

void multiply(const BlockMatrix& matrix, const VectorX& x, VectorX& y) {
  require_freedoms(narrow<std::size_t>(x.size()), matrix.node_count());
  y.resize(x.size());
  parallel_for_blocks(matrix.node_count(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      BlockSum sum;
      for (std::size_t k = matrix.row_start[i]; k < matrix.row_start[i + 1]; ++k) {
        sum.add(matrix.values.data() + 36 * k, x.data() + 6 * std::size_t{matrix.column[k]});
      }
      sum.store(y.data() + 6 * i);
    }
  });
}

void symmetrise(BlockMatrix& matrix) {
  for (std::size_t i = 0; i < matrix.node_count(); ++i) {
    for (std::size_t k = matrix.row_start[i]; k < matrix.row_start[i + 1]; ++k) {
      if (matrix.column[k] >= i) {
        const Matrix6 mean = 0.5 * (matrix.block(k) + matrix.block(matrix.transposed[k]).transpose());
        matrix.block(k) = mean;
        matrix.block(matrix.transposed[k]) = mean.transpose();
      }
    }
  }
}

double dot(const VectorX& a, const VectorX& b) {
  constexpr Eigen::Index grain = 8192;
  if (a.size() != b.size()) {
    throw InputError(fmt::format("vectors of {} and {} numbers have no product", a.size(), b.size()));
  }
  double sum = 0;
  for (Eigen::Index begin = 0; begin < a.size(); begin += grain) {
    const Eigen::Index size = std::min(grain, a.size() - begin);
    sum += a.segment(begin, size).dot(b.segment(begin, size));
  }
  return sum;
}

}  // namespace tunica
