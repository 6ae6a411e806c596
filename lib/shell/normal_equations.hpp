#pragma once

#include "core/lanes.hpp"
#include "shell/fit_samples.hpp"

#include <algorithm>
#include <array>

namespace tunica {

/// Adds a patch's residuals to the normal equations of a least-squares step: h += sum of w r r', g -= sum of w d r,
/// with d the distance of a residual, r how it follows the N unknowns, w = weight(|d|). Several residuals at once.
/// @param jacobian  how the ten control points (x, y, z of 0, then of 1, ...) follow the unknowns
/// @param weight  from Lanes to Lanes
template <int N, typename Weight>
void add_normal_equations(const Eigen::Matrix<double, 30, N>& jacobian, const std::vector<Residual>& residuals,
                          const Weight& weight, Eigen::Matrix<double, N, N>& h, Eigen::Matrix<double, N, 1>& g) {
  constexpr auto n = static_cast<std::size_t>(N);
  std::array<Lanes, n*(n + 1) / 2> products;
  std::array<Lanes, n> sides;
  products.fill(Lanes(0.0));
  sides.fill(Lanes(0.0));
  for (std::size_t i = 0; i < residuals.size(); i += lane_count) {
    const std::size_t last = residuals.size() - 1;
    const auto residual = [&](std::size_t k) -> const Residual& { return residuals[std::min(i + k, last)]; };
    const Lanes l2 = lanes_of([&](std::size_t k) { return residual(k).at[0]; });
    const Lanes l3 = lanes_of([&](std::size_t k) { return residual(k).at[1]; });
    const Lanes distance = lanes_of([&](std::size_t k) { return residual(k).distance; });
    const LaneVec3 direction = lane_points([&](std::size_t k) -> const Vec3& { return residual(k).direction; });
    const Lanes counted = lanes_of([&](std::size_t k) { return i + k <= last ? 1.0 : 0.0; });
    const Lanes w = counted * weight(Lanes(std::experimental::abs(distance)));
    const Lanes l1 = 1.0 - l2 - l3;
    const std::array<Lanes, 10> basis{l1 * l1 * l1,       l2 * l2 * l2,       l3 * l3 * l3,       3.0 * l1 * l1 * l2,
                                      3.0 * l1 * l2 * l2, 3.0 * l2 * l2 * l3, 3.0 * l2 * l3 * l3, 3.0 * l3 * l3 * l1,
                                      3.0 * l3 * l1 * l1, 6.0 * l1 * l2 * l3};
    std::array<Lanes, n> row;
    row.fill(Lanes(0.0));
    for (std::size_t j = 0; j < 10; ++j) {
      for (Eigen::Index k = 0; k < 3; ++k) {
        const Lanes moved = basis[j] * direction[k];
        for (std::size_t c = 0; c < n; ++c) {
          row[c] += moved * jacobian(3 * static_cast<Eigen::Index>(j) + k, static_cast<Eigen::Index>(c));
        }
      }
    }
    std::size_t p = 0;
    for (std::size_t a = 0; a < n; ++a) {
      const Lanes weighted = w * row[a];
      sides[a] -= weighted * distance;
      for (std::size_t b = 0; b <= a; ++b) {
        products[p++] += weighted * row[b];
      }
    }
  }
  std::size_t p = 0;
  for (Eigen::Index a = 0; a < N; ++a) {
    g[a] += std::experimental::reduce(sides[static_cast<std::size_t>(a)]);
    for (Eigen::Index b = 0; b <= a; ++b) {
      const double sum = std::experimental::reduce(products[p++]);
      h(a, b) += sum;
      if (b != a) {
        h(b, a) += sum;
      }
    }
  }
}

}  // namespace tunica
