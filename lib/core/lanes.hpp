#pragma once

#include "tunica/core/lane_count.hpp"
#include "tunica/core/simd.hpp"

#include <Eigen/Core>

/// Several numbers that go through the same arithmetic at once, as the scalar of small Eigen matrices: the same formula
/// for several things. What Eigen vectorises within one 3x3 or 6x6 block is little; across things it is everything.
namespace tunica {

using Lanes = simd::Vector<double, lane_count>;
using LaneMask = Lanes::mask_type;

}  // namespace tunica

namespace Eigen {

template <>
struct NumTraits<tunica::Lanes> : GenericNumTraits<tunica::Lanes> {
  using Real = tunica::Lanes;
  using NonInteger = tunica::Lanes;
  using Nested = tunica::Lanes;
  using Literal = double;
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 0,
    ReadCost = 1,
    AddCost = 1,
    MulCost = 1
  };
};

template <typename Operation>
struct ScalarBinaryOpTraits<tunica::Lanes, double, Operation> {
  using ReturnType = tunica::Lanes;
};
template <typename Operation>
struct ScalarBinaryOpTraits<double, tunica::Lanes, Operation> {
  using ReturnType = tunica::Lanes;
};

}  // namespace Eigen

namespace tunica {

using LaneVec2 = Eigen::Matrix<Lanes, 2, 1>;
using LaneVec3 = Eigen::Matrix<Lanes, 3, 1>;

/// A scalar of each thing. @param value  of thing k, 0 <= k < lane_count
template <typename Value>
Lanes lanes_of(const Value& value) {
  return Lanes([&](auto k) { return value(std::size_t{k}); });
}

/// A point of each thing.
template <typename Point>
LaneVec3 lane_points(const Point& point) {
  LaneVec3 result;
  for (Eigen::Index i = 0; i < 3; ++i) {
    result[i] = Lanes([&](auto k) { return point(std::size_t{k})[i]; });
  }
  return result;
}

}  // namespace tunica
