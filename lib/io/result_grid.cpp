#include "io/result_grid.hpp"

#include "core/error.hpp"
#include "mechanics/curved_displacement.hpp"

#include <algorithm>

namespace tunica {
namespace {

constexpr std::size_t most_fine_triangles = 200'000;
constexpr int finest_level = 4;

constexpr std::array fixed_fields{GridField{"normal", 3, false}, GridField{"thickness", 1, false}};
constexpr std::array point_fields{GridField{"displacement", 3, false}, GridField{"rotation", 3, false}};
constexpr std::array state_fields{point_fields[0],
                                  point_fields[1],
                                  GridField{"pressure", 1, true},
                                  GridField{"von_mises_top", 1, true},
                                  GridField{"von_mises_bottom", 1, true},
                                  GridField{"membrane_force", 3, true},
                                  GridField{"bending_moment", 3, true},
                                  GridField{"principal_strain_top", 2, true},
                                  GridField{"principal_strain_bottom", 2, true}};

using Floats = std::vector<float>;

template <typename Vector>
void add(Floats& values, const Vector& v) {
  for (Eigen::Index axis = 0; axis < v.size(); ++axis) {
    values.push_back(static_cast<float>(v[axis]));
  }
}

void add(Floats& values, double value) { values.push_back(static_cast<float>(value)); }

template <typename Value>
Floats flat(const std::vector<Value>& list) {
  Floats values;
  for (const Value& value : list) {
    add(values, value);
  }
  return values;
}

// Linear between the corners of a triangle.
template <typename Value>
Value between(const std::array<Index, 3>& corners, const Vec2& b, const Value* of_nodes) {
  return (1 - b.x() - b.y()) * of_nodes[corners[0]] + b.x() * of_nodes[corners[1]] + b.y() * of_nodes[corners[2]];
}

}  // namespace

int drawing_level(std::size_t shells) {
  int level = finest_level;
  while (level > 1 && shells * static_cast<std::size_t>(level * level) > most_fine_triangles) {
    --level;
  }
  return level;
}

std::span<const GridField> ResultGrid::fixed_layout() { return fixed_fields; }
std::span<const GridField> ResultGrid::layout() { return state_fields; }

ResultGrid::ResultGrid(const Model& model, int level) : model_(model) {
  for (const ShellBody& body : model.shells) {
    elements_ += body.mesh.triangles.size();
  }
  if (level == 0) {
    level = drawing_level(elements_);
  }
  Floats normals;
  Floats thicknesses;
  std::size_t first_element = 0;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const Tessellation& surface = bodies_.emplace_back(tessellate_uniformly(body.mesh, level));
    const auto patches = curved_patches(body.mesh);
    const std::size_t first = points();
    TUNICA_ASSERT(first + surface.mesh.vertices.size() <= max_index);
    for (std::size_t v = 0; v < surface.mesh.vertices.size(); ++v) {
      const Vec3& p = surface.mesh.vertices[v];
      coordinates_.insert(coordinates_.end(), p.data(), p.data() + 3);
      const Index shell = surface.vertex_shell[v];
      add(normals, patches[shell].normal(surface.barycentric[v]));
      add(thicknesses, body.thickness.size() == 1
                           ? body.thickness.front()
                           : between(body.mesh.triangles[shell], surface.barycentric[v], body.thickness.data()));
    }
    for (const auto& triangle : surface.mesh.triangles) {
      for (const Index v : triangle) {
        connectivity_.push_back(static_cast<std::int32_t>(first + v));
      }
    }
    body_of_cell_.insert(body_of_cell_.end(), surface.mesh.triangles.size(), static_cast<std::int32_t>(b));
    for (const Index shell : surface.shell) {
      element_of_cell_.push_back(first_element + shell);
    }
    first_element += body.mesh.triangles.size();
  }
  fixed_ = {std::move(normals), std::move(thicknesses)};
}

std::vector<std::vector<float>> ResultGrid::values(const State& state, const ElementFields& fields) const {
  Floats moved;
  Floats turned;
  moved.reserve(3 * points());
  turned.reserve(3 * points());
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Tessellation& surface = bodies_[b];
    for (const Vec3& u : curved_displacement(model_, b, state, surface)) {
      add(moved, u);
    }
    const Vec3* of_nodes = state.rotation.data() + model_.first_node(b);
    for (std::size_t v = 0; v < surface.mesh.vertices.size(); ++v) {
      const auto& corners = model_.shells[b].mesh.triangles[surface.vertex_shell[v]];
      add(turned, between(corners, surface.barycentric[v], of_nodes));
    }
  }
  std::vector<Floats> values{std::move(moved), std::move(turned)};
  for (const Floats& of_elements : element_values(fields)) {
    const std::size_t components = state_fields[values.size()].components;
    TUNICA_ASSERT(of_elements.size() == components * elements_);
    Floats& of_cells = values.emplace_back();
    of_cells.reserve(components * cells());
    for (const std::size_t element : element_of_cell_) {
      const auto first = of_elements.begin() + static_cast<std::ptrdiff_t>(components * element);
      of_cells.insert(of_cells.end(), first, first + static_cast<std::ptrdiff_t>(components));
    }
  }
  TUNICA_ASSERT(values.size() == state_fields.size());
  return values;
}

std::vector<std::vector<float>> element_values(const ElementFields& fields) {
  return {flat(fields.pressure),
          flat(fields.von_mises_top),
          flat(fields.von_mises_bottom),
          flat(fields.membrane_force),
          flat(fields.bending_moment),
          flat(fields.principal_strain_top),
          flat(fields.principal_strain_bottom)};
}

}  // namespace tunica
