#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

/// Units inside tunica, everywhere: mm, N, s; so MPa and tonne. Only parse_quantity and the file readers convert.
namespace tunica {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

/// No bound, no distance.
inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// Index of a vertex or triangle in a mesh. Counts are std::size_t; a mesh file holds at most 2^31 - 1 of each.
using Index = std::uint32_t;
inline constexpr std::size_t max_index = 0x7fffffff;

/// A certified interval: the true value v satisfies lower <= v <= upper, rounded outward.
struct Interval {
  double lower = 0;
  double upper = 0;
};

}  // namespace tunica
