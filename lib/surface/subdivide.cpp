#include "surface/subdivide.hpp"

#include "core/error.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

double longest_edge_of(const TriangleMesh& mesh, const std::array<Index, 3>& t) {
  const auto& v = mesh.vertices;
  return std::max({(v[t[1]] - v[t[0]]).norm(), (v[t[2]] - v[t[1]]).norm(), (v[t[0]] - v[t[2]]).norm()});
}

std::size_t pieces_per_edge(double length, double longest_edge) {
  return static_cast<std::size_t>(std::clamp(std::ceil(length / longest_edge), 1.0, 1000.0));
}

std::size_t count(const TriangleMesh& mesh, double longest_edge) {
  std::size_t sum = 0;
  for (const auto& triangle : mesh.triangles) {
    const std::size_t k = pieces_per_edge(longest_edge_of(mesh, triangle), longest_edge);
    sum += k * k;
  }
  return sum;
}

}  // namespace

TriangleMesh subdivided(const TriangleMesh& mesh, double longest_edge, std::size_t most_triangles) {
  TUNICA_ASSERT(longest_edge > 0);
  while (count(mesh, longest_edge) > std::max(most_triangles, mesh.triangles.size())) {
    longest_edge *= 1.25;
  }
  TriangleMesh fine{mesh.vertices, {}};
  for (const auto& triangle : mesh.triangles) {
    const std::size_t k = pieces_per_edge(longest_edge_of(mesh, triangle), longest_edge);
    if (k == 1) {
      fine.triangles.push_back(triangle);
      continue;
    }
    const Vec3 origin = mesh.vertices[triangle[0]];
    const Vec3 right = (mesh.vertices[triangle[1]] - origin) / static_cast<double>(k);
    const Vec3 up = (mesh.vertices[triangle[2]] - origin) / static_cast<double>(k);
    // Row j holds the points i = 0 .. k - j; its corners are given vertices.
    std::vector<Index> below;
    for (std::size_t j = 0; j <= k; ++j) {
      std::vector<Index> row;
      for (std::size_t i = 0; i + j <= k; ++i) {
        if ((i == 0 || i == k) && (j == 0 || j == k)) {
          row.push_back(triangle[i == k ? 1 : j == k ? 2 : 0]);
        } else {
          row.push_back(static_cast<Index>(fine.vertices.size()));
          fine.vertices.push_back(origin + static_cast<double>(i) * right + static_cast<double>(j) * up);
        }
      }
      for (std::size_t i = 0; j > 0 && i + 1 < below.size(); ++i) {
        fine.triangles.push_back({below[i], below[i + 1], row[i]});
        if (i + 1 < row.size()) {
          fine.triangles.push_back({below[i + 1], row[i + 1], row[i]});
        }
      }
      below = std::move(row);
    }
  }
  return fine;
}

}  // namespace tunica
