#include "tunica/io/result/result_picture.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/draw/picture.hpp"
#include "tunica/io/result/detail/result_grid.hpp"
#include "tunica/mechanics/contact/rigid_shape.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tunica {
namespace {

// Of the diagonal: what moves less is not told from its outline.
constexpr double seen_displacement = 0.003;

// The triangles of a grid, those of solids included; the points are the grid's.
TriangleMesh surface_of(const Model& model, const ResultGrid& grid) {
  TriangleMesh surface;
  for (std::size_t p = 0; p < grid.points(); ++p) {
    surface.vertices.emplace_back(grid.coordinates()[3 * p], grid.coordinates()[3 * p + 1],
                                  grid.coordinates()[3 * p + 2]);
  }
  for (std::size_t t = 0; t < grid.triangles(); ++t) {
    const std::int32_t* corners = grid.connectivity().data() + 3 * t;
    surface.triangles.push_back({narrow<Index>(corners[0]), narrow<Index>(corners[1]), narrow<Index>(corners[2])});
  }
  std::size_t first = grid.points();
  for (const SolidBody& solid : model.solids) {
    first -= solid.mesh.vertices.size();
  }
  for (const SolidBody& solid : model.solids) {
    for (const auto& [a, b, c] : boundary_triangles(solid.mesh)) {
      const auto of_grid = [&](Index v) { return narrow<Index>(first + v); };
      surface.triangles.push_back({of_grid(a), of_grid(b), of_grid(c)});
    }
    first += solid.mesh.vertices.size();
  }
  return surface;
}

// Largest stretch of each tetrahedron less one, as means at the nodes by volume.
void add_solid_strain(const SolidBody& solid, const Vec3* displacement, double* of_nodes) {
  const TetMesh& mesh = solid.mesh;
  std::vector<double> volumes(mesh.vertices.size(), 0);
  for (const auto& nodes : mesh.tetrahedra) {
    Mat3 before;
    Mat3 after;
    for (int k = 0; k < 3; ++k) {
      before.col(k) = mesh.vertices[nodes[k + 1]] - mesh.vertices[nodes[0]];
      after.col(k) = before.col(k) + displacement[nodes[k + 1]] - displacement[nodes[0]];
    }
    const double strain = Eigen::JacobiSVD<Mat3>(after * before.inverse()).singularValues()[0] - 1;
    for (const Index node : nodes) {
      of_nodes[node] += before.determinant() * strain;
      volumes[node] += before.determinant();
    }
  }
  for (std::size_t v = 0; v < volumes.size(); ++v) {
    of_nodes[v] = volumes[v] > 0 ? std::max(0.0, of_nodes[v] / volumes[v]) : 0;
  }
}

std::vector<double> strain_at_nodes(const Model& model, const State& state, const ElementFields& fields) {
  std::vector<double> strain = fields.strain;
  strain.resize(model.node_count(), 0);
  for (double& value : strain) {
    value = std::max(value, 0.0);
  }
  for (std::size_t s = 0; s < model.solids.size(); ++s) {
    const std::size_t first = model.first_node(model.shells.size() + s);
    add_solid_strain(model.solids[s], state.displacement.data() + first, strain.data() + first);
  }
  return strain;
}

// Of a convex body: points all around, far away, drawn to their nearest points.
TriangleMesh convex_surface(const RigidShape& shape, const Vec3& axis, double far) {
  constexpr int slices = 96;
  constexpr int rings = 48;
  const Vec3 u = axis.unitOrthogonal();
  const Vec3 v = axis.cross(u);
  TriangleMesh surface;
  for (int ring = 0; ring <= rings; ++ring) {
    for (int slice = 0; slice < slices; ++slice) {
      const double height = std::numbers::pi * (real(ring) / rings - 0.5);
      const double turn = 2 * std::numbers::pi * real(slice) / slices;
      const Vec3 away = std::sin(height) * axis + std::cos(height) * (std::cos(turn) * u + std::sin(turn) * v);
      const Vec3 p = shape.position() + far * away;
      const RigidDistance found = shape.at(p);
      surface.vertices.emplace_back(p - found.distance * found.normal);
      if (ring > 0) {
        const auto corner = [&](int r, int s) { return narrow<Index>(r * slices + s % slices); };
        surface.triangles.push_back({corner(ring - 1, slice), corner(ring - 1, slice + 1), corner(ring, slice + 1)});
        surface.triangles.push_back({corner(ring - 1, slice), corner(ring, slice + 1), corner(ring, slice)});
      }
    }
  }
  return surface;
}

// A rigid body at a time; of a plane a square, `reach` to each side, around the point closest to `near`.
TriangleMesh rigid_surface(const RigidBody& body, double time, const Vec3& near, double reach) {
  RigidShape shape(body);
  shape.set_time(time);
  if (const auto* plane = std::get_if<RigidPlane>(&body.shape)) {
    const Vec3 middle = near - shape.at(near).distance * plane->normal;
    const Vec3 u = reach * plane->normal.unitOrthogonal();
    const Vec3 v = plane->normal.cross(u);
    return {{middle - u - v, middle + u - v, middle + u + v, middle - u + v}, {{0, 1, 2}, {0, 2, 3}}};
  }
  if (const auto* mesh = std::get_if<RigidMesh>(&body.shape)) {
    const RigidBody as_read{body.name, RigidMesh{mesh->surface, {}, {}}, {}, {}};
    const RigidShape before(as_read);
    TriangleMesh surface = mesh->surface;
    for (Vec3& vertex : surface.vertices) {
      vertex = shape.carried(vertex, before);
    }
    return surface;
  }
  const double extent = shape.support(Vec3::UnitX()) + shape.support(-Vec3::UnitX()) + shape.support(Vec3::UnitY()) +
                        shape.support(-Vec3::UnitY()) + shape.support(Vec3::UnitZ()) + shape.support(-Vec3::UnitZ());
  const auto axis = [&](const auto& line) {
    const Vec3 along = line.to.at(time) - line.from.at(time);
    return along.norm() > 0 ? Vec3(along.normalized()) : Vec3(Vec3::UnitZ());
  };
  if (const auto* capsule = std::get_if<RigidCapsule>(&body.shape)) {
    return convex_surface(shape, axis(*capsule), 2 * extent);
  }
  if (const auto* cylinder = std::get_if<RigidCylinder>(&body.shape)) {
    return convex_surface(shape, axis(*cylinder), 2 * extent);
  }
  return convex_surface(shape, Vec3::UnitZ(), 2 * extent);
}

/// What is drawn: a value per point, in a unit for people.
struct ShownQuantity {
  std::vector<double> values;
  const char* title;
  const char* name;
  const char* unit;
  double per_unit;  ///< units in MPa, mm or 1
};

ShownQuantity quantity_of(const Model& model, const State& state, const ElementFields& fields, const ResultGrid& grid,
                          const std::vector<Floats>& of_points, const ResultPictureOptions& options) {
  ShownQuantity q;
  switch (options.colour) {
    case Colouring::displacement:
      q = {{}, "Displacement", "Displacement", "mm", 1};
      for (std::size_t p = 0; p < grid.points(); ++p) {
        q.values.push_back(std::hypot(of_points[0][3 * p], of_points[0][3 * p + 1], of_points[0][3 * p + 2]));
      }
      break;
    case Colouring::strain: {
      q = {{}, "Largest principal strain", "Strain", "%", 100};
      const Floats strain = grid.at_points(strain_at_nodes(model, state, fields));
      q.values.assign(strain.begin(), strain.end());
      break;
    }
    // As on the report's page, whatever its size: pictures of a cohort stand beside each other.
    case Colouring::membrane:
      q = {{of_points[2].begin(), of_points[2].end()}, "Membrane stress (von Mises)", "Membrane stress", "kPa", 1000};
      break;
    case Colouring::stress:
      q = {{of_points[3].begin(), of_points[3].end()},
           "Stress at the faces (von Mises)",
           "Stress at the faces",
           "kPa",
           1000};
      break;
  }
  for (double& value : q.values) {
    value *= q.per_unit;
  }
  return q;
}

}  // namespace

std::string result_picture(const Model& model, const State& state, const ElementFields& fields,
                           const ResultPictureOptions& options) {
  TUNICA_ASSERT(model.body_count() > 0 && options.magnify > 0);
  const ResultGrid grid(model, 0);
  const std::vector<Floats> of_points = grid.values(state, fields);
  const ShownQuantity quantity = quantity_of(model, state, fields, grid, of_points, options);

  TriangleMesh surface = surface_of(model, grid);
  const double size = diagonal(surface);
  PictureOptions look;
  look.outline = surface;
  double moved = 0;
  for (std::size_t p = 0; p < grid.points(); ++p) {
    const Vec3 shift(of_points[0][3 * p], of_points[0][3 * p + 1], of_points[0][3 * p + 2]);
    surface.vertices[p] += options.magnify * shift;
    moved = std::max(moved, options.magnify * shift.norm());
  }
  if (moved < seen_displacement * size) {
    look.outline = {};
  }
  const bool is_unloaded = std::ranges::any_of(model.loads, [](const Load& load) {
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    return pressure != nullptr && pressure->unload;
  });
  look.outline_name = is_unloaded ? "unloaded" : "as imaged";
  for (const auto& [from, to] : grid.shell_edges()) {
    look.lines.push_back({surface.vertices[from], surface.vertices[to]});
  }
  const Vec3 middle = surface.vertices[surface.triangles.front()[0]];
  for (const RigidBody& body : model.rigids) {
    const TriangleMesh drawn = rigid_surface(body, state.time, middle, size);
    const auto first = narrow<Index>(look.others.vertices.size());
    look.others.vertices.insert(look.others.vertices.end(), drawn.vertices.begin(), drawn.vertices.end());
    for (const auto& [a, b, c] : drawn.triangles) {
      look.others.triangles.push_back({first + a, first + b, first + c});
    }
  }
  look.title = fmt::format("{} {}", quantity.title, options.when);
  look.caption = options.magnify == 1 ? "Displacements are drawn at their true size"
                                      : fmt::format("Displacements are drawn {:g} times as large", options.magnify);
  look.quantity = quantity.name;
  look.unit = quantity.unit;
  if (options.range) {
    look.maximum = *options.range * quantity.per_unit;
  }
  return surface_picture(surface, quantity.values, look);
}

}  // namespace tunica
