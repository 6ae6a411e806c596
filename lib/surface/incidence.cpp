#include "surface/incidence.hpp"

#include "core/threads.hpp"

#include <algorithm>

namespace tunica {

Incidence incidence(std::size_t vertices, std::span<const std::array<Index, 3>> triangles) {
  Incidence result;
  result.offsets.assign(vertices + 1, 0);
  for (const auto& triangle : triangles) {
    for (const Index v : triangle) {
      ++result.offsets[v + 1];
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    result.offsets[v + 1] += result.offsets[v];
  }
  result.triangles.resize(3 * triangles.size());
  std::vector<std::size_t> next(result.offsets.begin(), result.offsets.end() - 1);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const Index v : triangles[t]) {
      result.triangles[next[v]++] = static_cast<Index>(t);
    }
  }
  return result;
}

std::vector<std::array<Index, 3>> neighbours(std::span<const std::array<Index, 3>> triangles, const Incidence& around) {
  std::vector<std::array<Index, 3>> result(triangles.size(), {no_neighbour, no_neighbour, no_neighbour});
  parallel_for_blocks(triangles.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index u = triangles[t][k];
        const Index v = triangles[t][(k + 1) % 3];
        Index other = no_neighbour;
        std::size_t shared = 0;
        for (const Index candidate : around.of(u)) {
          const auto& corners = triangles[candidate];
          if (candidate != t && (corners[0] == v || corners[1] == v || corners[2] == v)) {
            other = candidate;
            ++shared;
          }
        }
        if (shared == 1) {
          result[t][k] = other;
        }
      }
    }
  });
  return result;
}

std::vector<std::vector<Index>> boundary_loops(const TriangleMesh& mesh) {
  return boundary_loops(mesh.triangles, neighbours(mesh, incidence(mesh)));
}

std::vector<std::vector<Index>> boundary_loops(std::span<const std::array<Index, 3>> triangles,
                                               std::span<const std::array<Index, 3>> across) {
  std::vector<std::pair<Index, Index>> edges;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (across[t][k] == no_neighbour) {
        edges.emplace_back(triangles[t][k], triangles[t][(k + 1) % 3]);
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<bool> used(edges.size(), false);
  const auto next_unused = [&](Index from) {
    auto it = std::lower_bound(edges.begin(), edges.end(), std::pair<Index, Index>{from, 0});
    while (it != edges.end() && it->first == from && used[static_cast<std::size_t>(it - edges.begin())]) {
      ++it;
    }
    return it != edges.end() && it->first == from ? it : edges.end();
  };
  std::vector<std::vector<Index>> loops;
  for (std::size_t start = 0; start < edges.size(); ++start) {
    if (used[start]) {
      continue;
    }
    std::vector<Index> loop;
    for (auto it = edges.begin() + static_cast<std::ptrdiff_t>(start); it != edges.end();
         it = next_unused(it->second)) {
      used[static_cast<std::size_t>(it - edges.begin())] = true;
      loop.push_back(it->first);
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

}  // namespace tunica
