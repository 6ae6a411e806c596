#include "tunica/surface/mesh/subdivide.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/measure.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

std::size_t pieces_per_edge(double length, double longest_edge) {
  return truncated<std::size_t>(std::clamp(std::ceil(length / longest_edge), 1.0, 1000.0));
}

std::size_t count(const TriangleMesh& mesh, double longest_edge) {
  std::size_t sum = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    const std::size_t k = pieces_per_edge(tunica::longest_edge(mesh, t), longest_edge);
    sum += k * k;
  }
  return sum;
}

}  // namespace

TriangleMesh subdivided(const TriangleMesh& mesh, double longest_edge, std::size_t most_triangles) {
  require_valid(mesh);
  require_positive(longest_edge, "the length of the longest edge");
  while (count(mesh, longest_edge) > std::max(most_triangles, mesh.triangles.size())) {
    longest_edge *= 1.25;
  }
  TriangleMesh fine{mesh.vertices, {}};
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    const auto& triangle = mesh.triangles[t];
    const std::size_t k = pieces_per_edge(tunica::longest_edge(mesh, t), longest_edge);
    if (k == 1) {
      fine.triangles.push_back(triangle);
      continue;
    }
    const Vec3 origin = mesh.vertices[triangle[0]];
    const Vec3 right = (mesh.vertices[triangle[1]] - origin) / real(k);
    const Vec3 up = (mesh.vertices[triangle[2]] - origin) / real(k);
    // Row j holds the points i = 0 .. k - j; its corners are given vertices.
    std::vector<Index> below;
    for (std::size_t j = 0; j <= k; ++j) {
      std::vector<Index> row;
      for (std::size_t i = 0; i + j <= k; ++i) {
        if ((i == 0 || i == k) && (j == 0 || j == k)) {
          row.push_back(triangle[i == k ? 1 : j == k ? 2 : 0]);
        } else {
          row.push_back(narrow<Index>(fine.vertices.size()));
          fine.vertices.push_back(origin + real(i) * right + real(j) * up);
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

std::vector<int> parts_for_points(const TriangleMesh& mesh, const std::function<double(double)>& parts, double most) {
  std::vector<double> wanted(mesh.triangles.size());
  double points = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    wanted[t] = parts(longest_edge(mesh, t));
    points += 0.5 * wanted[t] * wanted[t];
  }
  const double share = points > most ? std::sqrt(most / points) : 1;
  std::vector<int> out(wanted.size());
  std::transform(wanted.begin(), wanted.end(), out.begin(), [&](double p) { return truncated<int>(share * p); });
  return out;
}

}  // namespace tunica
