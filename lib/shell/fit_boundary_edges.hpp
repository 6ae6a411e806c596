#pragma once

#include "shell/boundary_distance.hpp"
#include "shell/fit_mesh.hpp"
#include "surface/closest_point.hpp"

#include <cmath>
#include <optional>

namespace tunica {

/// The boundary edges of shells under edit, to find which of them is closest. Queries are thread-safe.
/// Cost: linear in the edges; a query some microsecond.
class BoundaryEdges {
public:
  /// @param chords  that stand for each edge's curve
  explicit BoundaryEdges(const FitMesh& mesh, std::size_t chords = 8) : chords_(chords) {
    std::vector<CubicCurve> curves;
    for (const FitMesh::BoundaryEdge& edge : mesh.boundary()) {
      curves.push_back(edge.curve);
      triangles_.push_back(edge.triangle);
    }
    if (!curves.empty()) {
      tree_.emplace(chords_of(curves, static_cast<int>(chords)).mesh);
    }
  }

  struct Hit {
    Index triangle;   ///< whose edge it is
    double distance;  ///< mm, from the chords
  };

  [[nodiscard]] bool empty() const { return triangles_.empty(); }
  /// There must be edges.
  [[nodiscard]] Hit closest(const Vec3& p) const {
    const auto hit = tree_->closest(p);
    return {triangles_[hit.triangle / chords_], std::sqrt(hit.squared_distance)};
  }

private:
  std::size_t chords_;
  std::vector<Index> triangles_;
  std::optional<ClosestPoint> tree_;
};

}  // namespace tunica
