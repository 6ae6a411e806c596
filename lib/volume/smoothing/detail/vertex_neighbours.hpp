#pragma once

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace tunica {

/// The neighbours of each vertex of a mesh: all around an inner vertex, along the boundary for one on the boundary.
class VertexNeighbours {
public:
  /// @param boundary  for each vertex, whether it is on the boundary: of such a one only neighbours along edges with
  /// one triangle count
  VertexNeighbours(const TriangleMesh& mesh, const std::vector<bool>& boundary);

  [[nodiscard]] std::span<const Index> of(std::size_t vertex) const {
    return {list_.data() + first_[vertex], list_.data() + first_[vertex + 1]};
  }
  [[nodiscard]] bool alone(std::size_t vertex) const { return first_[vertex] == first_[vertex + 1]; }

  /// x minus the mean of its neighbours.
  template <typename T>
  [[nodiscard]] T laplacian(const std::vector<T>& x, std::size_t vertex) const {
    const std::span<const Index> around = of(vertex);
    T sum = x[around[0]];
    for (std::size_t i = 1; i < around.size(); ++i) {
      sum += x[around[i]];
    }
    return x[vertex] - sum / real(around.size());
  }
  /// Mean square of the lengths of the edges to its neighbours.
  [[nodiscard]] double squared_edge(const std::vector<Vec3>& x, std::size_t vertex) const {
    double sum = 0;
    for (const Index other : of(vertex)) {
      sum += (x[other] - x[vertex]).squaredNorm();
    }
    return sum / real(of(vertex).size());
  }

private:
  std::vector<std::size_t> first_;
  std::vector<Index> list_;
};

}  // namespace tunica
