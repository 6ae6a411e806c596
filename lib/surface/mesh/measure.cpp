#include "tunica/surface/mesh/measure.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace tunica {

Box bounding_box(const TriangleMesh& mesh) {
  require_valid(mesh);
  if (mesh.triangles.empty()) {
    return {};
  }
  const Vec3& first = mesh.vertices[mesh.triangles[0][0]];
  Box box{first, first};
  for (const auto& triangle : mesh.triangles) {
    for (const Index v : triangle) {
      box.lower = box.lower.cwiseMin(mesh.vertices[v]);
      box.upper = box.upper.cwiseMax(mesh.vertices[v]);
    }
  }
  return box;
}

double diagonal(const TriangleMesh& mesh) { return bounding_box(mesh).diagonal(); }

std::optional<double> section_roundness(const TriangleMesh& mesh, const Vec3& point, const Vec3& normal) {
  require_valid(mesh);
  const auto height = [&](Index vertex) { return normal.dot(mesh.vertices[vertex] - point); };
  double perimeter = 0;
  Vec3 twice_area = Vec3::Zero();
  Vec3 closure = Vec3::Zero();  // the segments go round: they add up to nothing
  for (const auto& triangle : mesh.triangles) {
    std::array<Vec3, 2> ends;  // where the boundary of the triangle goes up through the plane, and down
    std::size_t crossings = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = triangle[k];
      const Index b = triangle[(k + 1) % 3];
      const double from = height(a);
      const double to = height(b);
      if ((from < 0) != (to < 0)) {
        ends[from < 0 ? 0 : 1] = mesh.vertices[a] + from / (from - to) * (mesh.vertices[b] - mesh.vertices[a]);
        ++crossings;
      }
    }
    if (crossings == 2) {
      const Vec3 along = ends[1] - ends[0];
      perimeter += along.norm();
      closure += along;
      twice_area += (ends[0] - point).cross(along);
    }
  }
  constexpr double round_off = 1e-9;
  if (!(perimeter > 0) || closure.norm() > round_off * perimeter) {
    return std::nullopt;
  }
  return 2 * std::numbers::pi * std::abs(twice_area.dot(normal.normalized())) / (perimeter * perimeter);
}

double triangle_area(const Vec3& a, const Vec3& b, const Vec3& c) { return 0.5 * (b - a).cross(c - a).norm(); }

double area(const TriangleMesh& mesh) {
  require_valid(mesh);
  double sum = 0;
  for (const auto& [i, j, k] : mesh.triangles) {
    sum += triangle_area(mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]);
  }
  return sum;
}

double signed_volume(const TriangleMesh& mesh) {
  // About the centre of the box: far from the origin the products would cancel.
  const Box box = bounding_box(mesh);
  const Vec3 centre = 0.5 * (box.lower + box.upper);
  double sum = 0;
  for (const auto& [i, j, k] : mesh.triangles) {
    sum += (mesh.vertices[i] - centre).dot((mesh.vertices[j] - centre).cross(mesh.vertices[k] - centre));
  }
  return sum / 6;
}

double longest_edge(const TriangleMesh& mesh, Index triangle) {
  if (triangle >= mesh.triangles.size()) {
    throw InputError(fmt::format("there is no triangle {}, but {}", triangle, mesh.triangles.size()));
  }
  require_valid(mesh.vertices, {&mesh.triangles[triangle], 1});
  const auto& [i, j, k] = mesh.triangles[triangle];
  const Vec3 &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
  return std::sqrt(std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()}));
}

double angle_degrees(const Vec3& p, const Vec3& a, const Vec3& b) {
  return std::atan2((a - p).cross(b - p).norm(), (a - p).dot(b - p)) * 180 / std::numbers::pi;
}

double smallest_angle_degrees(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double doubled_area = (b - a).cross(c - a).norm();
  // atan2 of sine and cosine: acos would lose half the digits of a small angle.
  const auto angle = [&](const Vec3& p, const Vec3& q, const Vec3& r) {
    return std::atan2(doubled_area, (q - p).dot(r - p));
  };
  if (!(doubled_area > 0)) {
    return 0;
  }
  return std::min({angle(a, b, c), angle(b, c, a), angle(c, a, b)}) * 180 / std::numbers::pi;
}

double radius_ratio(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double x = (b - c).norm();
  const double y = (c - a).norm();
  const double z = (a - b).norm();
  const double squared_doubled_area = (b - a).cross(c - a).squaredNorm();
  // inradius = 2 area / perimeter, circumradius = x y z / (4 area)
  const double denominator = (x + y + z) * (x * y * z);
  return denominator > 0 ? 4 * squared_doubled_area / denominator : 0;
}

double min_angle_degrees(const TriangleMesh& mesh) {
  require_valid(mesh);
  double smallest = 60;
  for (const auto& [i, j, k] : mesh.triangles) {
    smallest = std::min(smallest, smallest_angle_degrees(mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]));
  }
  return smallest;
}

double mean_quality(const TriangleMesh& mesh) {
  require_valid(mesh);
  if (mesh.triangles.empty()) {
    return 1;
  }
  double sum = 0;
  for (const auto& [i, j, k] : mesh.triangles) {
    sum += radius_ratio(mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]);
  }
  return sum / real(mesh.triangles.size());
}

}  // namespace tunica
