#pragma once

#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <utility>

namespace tunica::testing {

inline const std::array<Vec2, 3> corner_at{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};

/// Largest distance of the edge curves of neighbours at equal parameters; how many edges two triangles share.
inline std::pair<double, std::size_t> largest_gap(const ShellMesh& shell) {
  const TriangleMesh flat = flat_facets(shell);
  const auto beside = neighbours(flat, incidence(flat));
  const auto patches = curved_patches(shell);
  double gap = 0;
  std::size_t edges = 0;
  for (std::size_t t = 0; t < patches.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index other = beside[t][k];
      if (other == no_neighbour || other < t) {
        continue;
      }
      const auto& v = shell.triangles[other];
      const auto l =
          static_cast<std::size_t>(std::find(v.begin(), v.end(), shell.triangles[t][(k + 1) % 3]) - v.begin());
      ++edges;
      for (int i = 0; i <= 32; ++i) {
        const double s = i / 32.0;
        const Vec3 here = patches[t].point((1 - s) * corner_at[k] + s * corner_at[(k + 1) % 3]);
        const Vec3 there = patches[other].point((1 - s) * corner_at[(l + 1) % 3] + s * corner_at[l]);
        gap = std::max(gap, (here - there).norm());
      }
    }
  }
  return {gap, edges};
}

}  // namespace tunica::testing
