#include "tunica/wall/face_distance.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace tunica {

FaceDistance distance_of_faces(const TriangleMesh& face, const TriangleMesh& other) {
  if (face.triangles.empty() || other.triangles.empty()) {
    throw InputError("a face of the wall has no triangles: its thickness is not known");
  }
  require_valid(face);
  const ClosestPoint closest(other);
  std::vector<double> distance(face.triangles.size());
  parallel_for_blocks(distance.size(), 4096, [&](std::size_t begin, std::size_t end) {
    check_interrupt();
    for (std::size_t t = begin; t < end; ++t) {
      const auto& [a, b, c] = face.triangles[t];
      const Vec3 middle = (face.vertices[a] + face.vertices[b] + face.vertices[c]) / 3;
      distance[t] = std::sqrt(closest.closest(middle).squared_distance);
    }
  });
  std::vector<std::pair<double, double>> by_distance;  // with the areas
  FaceDistance found;
  double whole = 0;
  for (std::size_t t = 0; t < distance.size(); ++t) {
    const auto& [a, b, c] = face.triangles[t];
    const double area = triangle_area(face.vertices[a], face.vertices[b], face.vertices[c]);
    by_distance.emplace_back(distance[t], area);
    found.mean += area * distance[t];
    whole += area;
  }
  found.mean /= whole;
  std::ranges::sort(by_distance);
  const auto quantile = [&](double share) {
    double below = 0;
    const auto at = std::ranges::find_if(by_distance, [&](const auto& one) {
      below += one.second;
      return below >= share * whole;
    });
    return at == by_distance.end() ? by_distance.back().first : at->first;
  };
  found.p5 = quantile(0.05);
  found.p95 = quantile(0.95);
  return found;
}

}  // namespace tunica
