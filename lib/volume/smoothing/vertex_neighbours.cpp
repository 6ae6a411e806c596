#include "tunica/volume/smoothing/detail/vertex_neighbours.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

namespace tunica {
namespace {

template <typename Visit>
void for_each_edge(const TriangleMesh& mesh, const Visit& visit) {
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      visit(t[i], t[(i + 1) % 3]);
    }
  }
}

}  // namespace

VertexNeighbours::VertexNeighbours(const TriangleMesh& mesh, const std::vector<bool>& boundary)
    : first_(mesh.vertices.size() + 1, 0) {
  // Every edge of an inner vertex is run along once in each direction; of a boundary edge the way back is missing.
  std::map<std::pair<Index, Index>, int> border_edges;
  for_each_edge(mesh, [&](Index a, Index b) {
    if (!boundary[a]) {
      ++first_[a + 1];
    } else if (boundary[b]) {
      ++border_edges[std::minmax(a, b)];
    }
  });
  std::erase_if(border_edges, [](const auto& edge) { return edge.second != 1; });
  for (const auto& [edge, uses] : border_edges) {
    ++first_[edge.first + 1];
    ++first_[edge.second + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  list_.resize(first_.back());
  std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
  for_each_edge(mesh, [&](Index a, Index b) {
    if (!boundary[a]) {
      list_[next[a]++] = b;
    }
  });
  for (const auto& [edge, uses] : border_edges) {
    list_[next[edge.first]++] = edge.second;
    list_[next[edge.second]++] = edge.first;
  }
}

}  // namespace tunica
