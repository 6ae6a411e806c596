#include "tunica/io/result/detail/result_surface.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/io/mesh/surface_file.hpp"

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace tunica {
namespace {

const Floats& field_of(const ResultGrid& grid, const std::vector<std::vector<float>>& values, std::string_view name) {
  const auto found = std::ranges::find(grid.layout(), name, [](const GridField& field) { return field.name; });
  TUNICA_ASSERT(found != grid.layout().end());
  return values[narrow<std::size_t>(found - grid.layout().begin())];
}

// Unit, of the triangles around weighted by their area.
std::vector<Vec3> shading_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3& a = mesh.vertices[t[0]];
    const Vec3 twice = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    for (const Index corner : t) {
      normals[corner] += twice;
    }
  }
  for (Vec3& normal : normals) {
    normal.stableNormalize();
  }
  return normals;
}

}  // namespace

void write_result_surface(const std::filesystem::path& path, const ResultGrid& grid,
                          const std::vector<std::vector<float>>& values, const std::string& made_by,
                          const std::string& space, bool overwrite) {
  const Floats& moved = field_of(grid, values, "displacement");
  const Floats& stress = field_of(grid, values, "membrane_stress");
  constexpr Index none = max_index;
  std::vector<Index> number(grid.points(), none);  // solids have points, too
  TriangleMesh mesh;
  std::vector<double> of_vertex;
  double largest = 0;
  for (std::size_t t = 0; t < grid.triangles(); ++t) {
    std::array<Index, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto point = narrow<std::size_t>(grid.connectivity()[3 * t + k]);
      if (number[point] == none) {
        number[point] = narrow<Index>(mesh.vertices.size());
        const auto at = [&](std::size_t axis) {
          return grid.coordinates()[3 * point + axis] + moved[3 * point + axis];
        };
        mesh.vertices.emplace_back(at(0), at(1), at(2));
        of_vertex.push_back(stress[point]);
        largest = std::isfinite(stress[point]) ? std::max<double>(largest, stress[point]) : largest;
      }
      corners[k] = number[point];
    }
    mesh.triangles.push_back(corners);
  }
  SurfaceLook look{shading_normals(mesh), {}};
  std::ranges::transform(of_vertex, std::back_inserter(look.colours),
                         [&](double value) { return bar_colour(largest > 0 ? value / largest : 0); });
  PlyOptions options;
  options.comments = {"made by " + made_by,
                      fmt::format("colours: membrane stress (von Mises) from 0 to {:.4g} MPa", largest)};
  options.space = space;
  options.overwrite = overwrite;
  write_surface(path, mesh, options, look);
}

}  // namespace tunica
