#include "tunica/mechanics/algebra/free_mask.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tunica {
namespace {

/// Both triples of a node's freedoms.
template <typename Turn>
void turn_nodes(const FreeMask& free, VectorX& v, const Turn& turn) {
  for (const NodeAxes& own : free.own_axes) {
    for (const Eigen::Index part : {0, 3}) {
      auto triple = v.segment<3>(first_freedom(own.node) + part);
      triple = turn(own.axes, Vec3(triple));
    }
  }
}

}  // namespace

void to_own_axes(const FreeMask& free, VectorX& v) {
  turn_nodes(free, v, [](const Mat3& axes, const Vec3& x) { return Vec3(axes * x); });
}

void to_world_axes(const FreeMask& free, VectorX& v) {
  turn_nodes(free, v, [](const Mat3& axes, const Vec3& x) { return Vec3(axes.transpose() * x); });
}

void to_own_axes(const FreeMask& free, BlockMatrix& matrix) {
  for (const NodeAxes& own : free.own_axes) {
    for (std::size_t k = matrix.row_start[own.node]; k < matrix.row_start[own.node + 1]; ++k) {
      auto row = matrix.block(k);
      for (const Eigen::Index part : {0, 3}) {
        row.middleRows<3>(part) = (own.axes * row.middleRows<3>(part)).eval();
      }
      auto column = matrix.block(matrix.transposed[k]);
      for (const Eigen::Index part : {0, 3}) {
        column.middleCols<3>(part) = (column.middleCols<3>(part) * own.axes.transpose()).eval();
      }
    }
  }
}

std::vector<bool> along_world(const FreeMask& free) {
  std::vector<bool> marks = free;
  for (const NodeAxes& own : free.own_axes) {
    std::fill_n(marks.begin() + first_freedom(own.node), 6, false);
  }
  return marks;
}

void mask(const FreeMask& free, VectorX& v) {
  if (narrow<std::size_t>(v.size()) != free.size()) {
    throw InputError(fmt::format("{} marks for {} numbers", free.size(), v.size()));
  }
  to_own_axes(free, v);
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (!free[i]) {
      v[i] = 0;
    }
  }
  to_world_axes(free, v);
}

}  // namespace tunica
