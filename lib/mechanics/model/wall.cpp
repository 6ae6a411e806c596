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

double area_quantile(std::span<const Facet> facets, double above) {
  require_not_negative(above, "the part of the area");
  constexpr int halvings = 40;
  double low = infinity;
  double high = -infinity;
  double whole = 0;
  for (const Facet& facet : facets) {
    const auto [least, most] = std::ranges::minmax(facet.values);
    low = std::min(low, least);
    high = std::max(high, most);
    whole += facet.area;
  }
  std::vector<Facet> open(facets.begin(), facets.end());  // of which a part may be above
  double wholly_above = 0;
  for (int i = 0; i < halvings && low < high; ++i) {
    const double middle = (low + high) / 2;
    double area_above = wholly_above;
    for (const Facet& facet : open) {
      area_above += facet.area * part_above(facet.values, middle);
    }
    if (area_above > above * whole) {
      low = middle;
      std::erase_if(open, [&](const Facet& facet) { return *std::ranges::max_element(facet.values) <= low; });
    } else {
      high = middle;
      std::erase_if(open, [&](const Facet& facet) {
        const bool is_above = *std::ranges::min_element(facet.values) >= high;
        wholly_above += is_above ? facet.area : 0;
        return is_above;
      });
    }
  }
  return high;
}

double area_mean(std::span<const Facet> facets) {
  double sum = 0, area = 0;
  for (const Facet& facet : facets) {
    sum += facet.area * (facet.values[0] + facet.values[1] + facet.values[2]) / 3;
    area += facet.area;
  }
  return area > 0 ? sum / area : 0;
}

double area_quantile(const Model& model, std::span<const double> of_nodes, double above) {
  if (of_nodes.size() != model.node_count()) {
    throw InputError(fmt::format("{} values for {} nodes", of_nodes.size(), model.node_count()));
  }
  std::vector<Facet> facets;
  for_each_facet(model, [&](double area, const auto& nodes) {
    facets.push_back({area, {of_nodes[nodes[0]], of_nodes[nodes[1]], of_nodes[nodes[2]]}});
  });
  return area_quantile(facets, above);
}

}  // namespace tunica
