#include "tunica/mechanics/model/wall.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/require.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>

namespace tunica {
namespace {

/// Calls visit(area, corners' global nodes) for every triangle.
template <typename Visit>
void for_each_facet(const Model& model, const Visit& visit) {
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellMesh& mesh = model.shells[b].mesh;
    require_corners(mesh.vertices.size(), mesh.triangles);
    const std::size_t first = model.first_node(b);
    for (const auto& [i, j, k] : mesh.triangles) {
      const Vec3& origin = mesh.vertices[i];
      const double area = (mesh.vertices[j] - origin).cross(mesh.vertices[k] - origin).norm() / 2;
      visit(area, std::array<std::size_t, 3>{first + i, first + j, first + k});
    }
  }
}

/// The part of a triangle on which a linear function passes `level`.
double part_above(std::array<double, 3> corners, double level) {
  std::sort(corners.begin(), corners.end());
  const auto [low, middle, high] = corners;
  if (level >= high) {
    return 0;
  }
  if (level < low) {
    return 1;
  }
  return level >= middle ? (high - level) * (high - level) / ((high - low) * (high - middle))
                         : 1 - (level - low) * (level - low) / ((high - low) * (middle - low));
}

}  // namespace

double least_thickness(const Model& model) {
  double least = infinity;
  for (const ShellBody& body : model.shells) {
    if (body.thickness.empty()) {
      throw InputError(body.name + ": has no thickness");
    }
    least = std::min(least, *std::min_element(body.thickness.begin(), body.thickness.end()));
  }
  return least;
}

std::vector<double> averaged_at_nodes(const Model& model, std::span<const double> of_triangles) {
  std::size_t triangles = 0;
  for (const ShellBody& body : model.shells) {
    triangles += body.mesh.triangles.size();
  }
  if (of_triangles.size() != triangles) {
    throw InputError(fmt::format("{} values for {} triangles", of_triangles.size(), triangles));
  }
  std::vector<double> sum(model.node_count(), 0);
  std::vector<double> weight(model.node_count(), 0);
  std::size_t triangle = 0;
  for_each_facet(model, [&](double area, const auto& nodes) {
    for (const std::size_t node : nodes) {
      sum[node] += area * of_triangles[triangle];
      weight[node] += area;
    }
    ++triangle;
  });
  for (std::size_t i = 0; i < sum.size(); ++i) {
    sum[i] = weight[i] > 0 ? sum[i] / weight[i] : 0;
  }
  return sum;
}

double area_quantile(const Model& model, std::span<const double> of_nodes, double above) {
  require_not_negative(above, "the part of the area");
  if (of_nodes.size() != model.node_count()) {
    throw InputError(fmt::format("{} values for {} nodes", of_nodes.size(), model.node_count()));
  }
  constexpr int halvings = 40;
  std::vector<std::pair<double, std::array<double, 3>>> facets;
  double whole = 0;
  for_each_facet(model, [&](double area, const auto& nodes) {
    facets.push_back({area, {of_nodes[nodes[0]], of_nodes[nodes[1]], of_nodes[nodes[2]]}});
    whole += area;
  });
  const auto [least, most] = std::minmax_element(of_nodes.begin(), of_nodes.end());
  double low = *least;
  double high = *most;
  for (int i = 0; i < halvings && low < high; ++i) {
    const double middle = (low + high) / 2;
    double area_above = 0;
    for (const auto& [area, corners] : facets) {
      area_above += area * part_above(corners, middle);
    }
    (area_above > above * whole ? low : high) = middle;
  }
  return high;
}

}  // namespace tunica
