#include "tunica/wall/face_distance.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tunica {

FaceDistance distance_of_faces(const TriangleMesh& face, const TriangleMesh& other) {
  if (face.triangles.empty() || other.triangles.empty()) {
    throw InputError("a face of the wall has no triangles: its thickness is not known");
  }
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
  FaceDistance found{0, *std::ranges::min_element(distance), *std::ranges::max_element(distance)};
  double whole = 0;
  for (std::size_t t = 0; t < distance.size(); ++t) {
    const auto& [a, b, c] = face.triangles[t];
    const double area = triangle_area(face.vertices[a], face.vertices[b], face.vertices[c]);
    found.mean += area * distance[t];
    whole += area;
  }
  found.mean /= whole;
  return found;
}

}  // namespace tunica
