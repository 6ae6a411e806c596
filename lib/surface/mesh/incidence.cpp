#include "tunica/surface/mesh/incidence.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <algorithm>

namespace tunica {

Incidence incidence(std::size_t vertices, std::span<const std::array<Index, 3>> triangles) {
  require_corners(vertices, triangles);
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
      result.triangles[next[v]++] = narrow<Index>(t);
    }
  }
  return result;
}

std::vector<std::array<Index, 3>> neighbours(std::span<const std::array<Index, 3>> triangles, const Incidence& around) {
  require_corners(around.offsets.empty() ? 0 : around.offsets.size() - 1, triangles);
  std::vector<std::array<Index, 3>> result(triangles.size(), {no_neighbour, no_neighbour, no_neighbour});
  parallel_for_blocks(triangles.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index u = triangles[t][k];
        const Index v = triangles[t][(k + 1) % 3];
        // At the end with fewer triangles: over all edges those are few, even where one vertex has all triangles.
        const bool fewer_at_u = around.of(u).size() <= around.of(v).size();
        const Index far = fewer_at_u ? v : u;
        Index other = no_neighbour;
        std::size_t shared = 0;
        for (const Index candidate : around.of(fewer_at_u ? u : v)) {
          const auto& corners = triangles[candidate];
          if (candidate != t && (corners[0] == far || corners[1] == far || corners[2] == far)) {
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

namespace {

using DirectedEdge = std::pair<Index, Index>;

std::vector<std::vector<Index>> loops_of(std::vector<DirectedEdge> edges) {
  std::sort(edges.begin(), edges.end());
  std::vector<bool> used(edges.size(), false);
  const auto next_unused = [&](Index from) {
    auto it = std::lower_bound(edges.begin(), edges.end(), DirectedEdge{from, 0});
    while (it != edges.end() && it->first == from && used[it - edges.begin()]) {
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
    for (auto it = edges.begin() + start; it != edges.end(); it = next_unused(it->second)) {
      used[it - edges.begin()] = true;
      loop.push_back(it->first);
    }
    loops.push_back(std::move(loop));
  }
  return loops;
}

}  // namespace

std::vector<std::array<Index, 2>> boundary_edges(std::span<const std::array<Index, 3>> across) {
  std::vector<std::array<Index, 2>> edges;
  for (Index t = 0; t < across.size(); ++t) {
    for (Index k = 0; k < 3; ++k) {
      if (across[t][k] == no_neighbour) {
        edges.push_back({t, k});
      }
    }
  }
  return edges;
}

std::vector<std::vector<Index>> boundary_loops(const TriangleMesh& mesh) {
  require_corners(mesh.vertices.size(), mesh.triangles);
  // The edges known so far in a list at their end with fewer triangles, each with the number of its triangles.
  struct Edge {
    Index far, before, triangles;
  };
  constexpr Index none = 0xffffffff;
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size() / 2 + 1);
  std::vector<Index> last(mesh.vertices.size(), none);
  std::vector<Index> valence(mesh.vertices.size(), 0);
  for (const auto& c : mesh.triangles) {
    for (const Index v : c) {
      ++valence[v];
    }
  }
  std::vector<Index> edge_of;
  edge_of.reserve(3 * mesh.triangles.size());
  for (const auto& c : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [near, far] = std::minmax({c[k], c[(k + 1) % 3]}, [&](Index u, Index v) {
        return std::pair(valence[u], u) < std::pair(valence[v], v);
      });
      Index edge = last[near];
      while (edge != none && edges[edge].far != far) {
        edge = edges[edge].before;
      }
      if (edge == none) {
        edge = narrow<Index>(edges.size());
        edges.push_back({far, last[near], 0});
        last[near] = edge;
      }
      ++edges[edge].triangles;
      edge_of.push_back(edge);
    }
  }
  std::vector<DirectedEdge> found;
  for (std::size_t h = 0; h < edge_of.size(); ++h) {
    if (edges[edge_of[h]].triangles != 2) {
      const auto& c = mesh.triangles[h / 3];
      found.emplace_back(c[h % 3], c[(h % 3 + 1) % 3]);
    }
  }
  return loops_of(std::move(found));
}

std::vector<std::vector<Index>> boundary_loops(std::span<const std::array<Index, 3>> triangles,
                                               std::span<const std::array<Index, 3>> across) {
  if (across.size() != triangles.size()) {
    throw InputError("the neighbours are not those of the triangles: their numbers differ");
  }
  std::vector<DirectedEdge> edges;
  for (const auto& [t, k] : boundary_edges(across)) {
    edges.emplace_back(triangles[t][k], triangles[t][(k + 1) % 3]);
  }
  return loops_of(std::move(edges));
}

}  // namespace tunica
