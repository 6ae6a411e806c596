#include "tunica/mechanics/runs/result_grid.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/runs/curved_displacement.hpp"
#include "tunica/shell/patch/patch_edges.hpp"
#include "tunica/surface/mesh/tet_checks.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string_view>

namespace tunica {
namespace {

constexpr std::size_t most_fine_triangles = 200'000;
constexpr int finest_level = 4;

constexpr float no_value = std::numeric_limits<float>::quiet_NaN();
constexpr std::array fixed_fields{GridField{"normal", 3, false}, GridField{"thickness", 1, false}};
constexpr std::array point_fields{GridField{"displacement", 3, false}, GridField{"rotation", 3, false},
                                  GridField{"membrane_stress", 1, false}, GridField{"von_mises", 1, false}};
constexpr std::array shell_fields{GridField{"pressure", 1, true},
                                  GridField{"von_mises_top", 1, true},
                                  GridField{"von_mises_bottom", 1, true},
                                  GridField{"membrane_von_mises", 1, true},
                                  GridField{"tension", 1, true},
                                  GridField{"membrane_force", 3, true},
                                  GridField{"bending_moment", 3, true},
                                  GridField{"principal_strain_top", 2, true},
                                  GridField{"principal_strain_bottom", 2, true}};
// `pressure` is the load's on a shell: the state of stress of a solid has a name of its own.
constexpr std::array solid_fields{GridField{"solid_von_mises", 1, true, true},
                                  GridField{"solid_pressure", 1, true, true}};

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
  return Value((1 - b.x() - b.y()) * of_nodes[corners[0]] + b.x() * of_nodes[corners[1]] +
               b.y() * of_nodes[corners[2]]);
}

}  // namespace

int drawing_level(std::size_t shells) {
  int level = finest_level;
  while (level > 1 && shells * narrow<std::size_t>(level * level) > most_fine_triangles) {
    --level;
  }
  return level;
}

ResultGrid::Body ResultGrid::make_body(const ShellMesh& mesh, int level) {
  Body body{tessellate_uniformly(mesh, level), {}, {}, mesh.vertices.size()};
  // Where a vertex is, as the weights of the nodes it depends on: the same from both sides of an edge.
  using Key = std::array<std::pair<Index, int>, 2>;
  std::map<Key, Index> of_edges;
  std::vector<double> shared(body.points, 0);
  for (std::size_t v = 0; v < body.surface.mesh.vertices.size(); ++v) {
    const Vec2& b = body.surface.barycentric[v];
    const auto& corners = mesh.triangles[body.surface.vertex_shell[v]];
    const auto second = narrow<int>(std::lround(level * b.x()));
    const auto third = narrow<int>(std::lround(level * b.y()));
    std::vector<std::pair<Index, int>> weights;
    for (const auto& [node, weight] :
         {std::pair{corners[0], level - second - third}, std::pair{corners[1], second}, std::pair{corners[2], third}}) {
      if (weight > 0) {
        weights.emplace_back(node, weight);
      }
    }
    auto point = narrow<Index>(shared.size());  // a new one, where no other shares it
    if (weights.size() == 1) {
      point = weights[0].first;
    } else if (weights.size() == 2) {
      point = of_edges.emplace(Key{std::min(weights[0], weights[1]), std::max(weights[0], weights[1])}, point)
                  .first->second;
    }
    shared.resize(std::max<std::size_t>(shared.size(), std::size_t{point} + 1), 0);
    shared[point] += 1;
    body.point.push_back(point);
  }
  body.points = shared.size();
  for (const Index point : body.point) {
    body.weight.push_back(1 / shared[point]);
  }
  return body;
}

template <typename OfVertex>
void ResultGrid::add_means(const Body& body, const OfVertex& of_vertex, std::vector<float>& values) {
  using Value = std::decay_t<decltype(of_vertex(std::size_t{0}))>;
  std::vector<Value> means;
  if constexpr (std::is_same_v<Value, double>) {
    means.assign(body.points, 0);
  } else {
    means.assign(body.points, Value::Zero());
  }
  for (std::size_t v = 0; v < body.point.size(); ++v) {
    means[body.point[v]] += body.weight[v] * of_vertex(v);
  }
  for (const Value& mean : means) {
    add(values, mean);
  }
}

ResultGrid::ResultGrid(const Model& model, int level) : model_(model) {
  for (const ShellBody& body : model.shells) {
    elements_ += body.mesh.triangles.size();
  }
  layout_.assign(point_fields.begin(), point_fields.end());
  if (!model.shells.empty()) {
    layout_.insert(layout_.end(), shell_fields.begin(), shell_fields.end());
    level_ = level == 0 ? drawing_level(elements_) : level;
    add_shells();
  }
  shell_points_ = points();
  if (!model.solids.empty()) {
    layout_.insert(layout_.end(), solid_fields.begin(), solid_fields.end());
    add_solids();
  }
}

void ResultGrid::add_shells() {
  Floats normals;
  Floats thicknesses;
  std::size_t first_element = 0;
  for (std::size_t b = 0; b < model_.shells.size(); ++b) {
    const ShellBody& shell = model_.shells[b];
    const Body& body = bodies_.emplace_back(make_body(shell.mesh, level_));
    const Tessellation& surface = body.surface;
    const auto patches = curved_patches(shell.mesh);
    const std::size_t first = points();
    TUNICA_ASSERT(first + body.points <= max_index);
    std::vector<Vec3> means(body.points, Vec3::Zero());
    std::vector<Vec3> normal(body.points, Vec3::Zero());
    for (std::size_t v = 0; v < body.point.size(); ++v) {
      means[body.point[v]] += body.weight[v] * surface.mesh.vertices[v];
      normal[body.point[v]] += patches[surface.vertex_shell[v]].normal(surface.barycentric[v]);
    }
    std::copy(shell.mesh.vertices.begin(), shell.mesh.vertices.end(), means.begin());  // to the bit
    for (std::size_t i = 0; i < means.size(); ++i) {
      coordinates_.insert(coordinates_.end(), means[i].data(), means[i].data() + 3);
      add(normals, normal[i].stableNormalized());
    }
    add_means(
        body,
        [&](std::size_t v) {
          return shell.thickness.size() == 1 ? shell.thickness.front()
                                             : between(shell.mesh.triangles[surface.vertex_shell[v]],
                                                       surface.barycentric[v], shell.thickness.data());
        },
        thicknesses);
    for (const auto& triangle : surface.mesh.triangles) {
      for (const Index v : triangle) {
        connectivity_.push_back(narrow<std::int32_t>(first + body.point[v]));
      }
      ends_.push_back(narrow<std::int32_t>(connectivity_.size()));
      types_.push_back(vtk_triangle);
    }
    body_of_cell_.insert(body_of_cell_.end(), surface.mesh.triangles.size(), narrow<std::int32_t>(b));
    for (const Index element : surface.shell) {
      element_of_cell_.push_back(first_element + element);
    }
    first_element += shell.mesh.triangles.size();
  }
  fixed_layout_.assign(fixed_fields.begin(), fixed_fields.end());
  fixed_ = {std::move(normals), std::move(thicknesses)};
}

void ResultGrid::add_solids() {
  for (std::size_t s = 0; s < model_.solids.size(); ++s) {
    const TetMesh& mesh = model_.solids[s].mesh;
    const std::size_t first = points();
    TUNICA_ASSERT(first + mesh.vertices.size() <= max_index);
    for (const Vec3& vertex : mesh.vertices) {
      coordinates_.insert(coordinates_.end(), vertex.data(), vertex.data() + 3);
    }
    for (const auto& tetrahedron : mesh.tetrahedra) {
      for (const Index v : tetrahedron) {
        connectivity_.push_back(narrow<std::int32_t>(first + v));
      }
      ends_.push_back(narrow<std::int32_t>(connectivity_.size()));
      types_.push_back(vtk_tetrahedron);
      body_of_cell_.push_back(narrow<std::int32_t>(model_.shells.size() + s));
    }
  }
  for (std::size_t i = 0; i < fixed_.size(); ++i) {
    fixed_[i].resize(fixed_layout_[i].components * points(), no_value);
  }
}

TriangleMesh ResultGrid::surface() const {
  TriangleMesh surface;
  for (std::size_t p = 0; p < points(); ++p) {
    surface.vertices.emplace_back(coordinates_[3 * p], coordinates_[3 * p + 1], coordinates_[3 * p + 2]);
  }
  for (std::size_t t = 0; t < triangles(); ++t) {
    const std::int32_t* corners = connectivity_.data() + 3 * t;
    surface.triangles.push_back({narrow<Index>(corners[0]), narrow<Index>(corners[1]), narrow<Index>(corners[2])});
  }
  std::size_t first = shell_points_;
  for (const SolidBody& solid : model_.solids) {
    const auto of_grid = [&](Index v) { return narrow<Index>(first + v); };
    for (const auto& [a, b, c] : boundary_triangles(solid.mesh)) {
      surface.triangles.push_back({of_grid(a), of_grid(b), of_grid(c)});
    }
    first += solid.mesh.vertices.size();
  }
  return surface;
}

std::vector<std::vector<float>> ResultGrid::values(const State& state, const ElementFields& fields) const {
  std::vector<Floats> values(point_fields.size());
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Body& body = bodies_[b];
    const std::size_t first = model_.first_node(b);
    const std::vector<Vec3> moved = curved_displacement(model_, b, state, body.surface);
    const auto linear = [&](const auto* of_nodes) {
      return [&body, &mesh = model_.shells[b].mesh, of_nodes](std::size_t v) {
        return between(mesh.triangles[body.surface.vertex_shell[v]], body.surface.barycentric[v], of_nodes);
      };
    };
    add_means(
        body, [&](std::size_t v) { return moved[v]; }, values[0]);
    add_means(body, linear(state.rotation.data() + first), values[1]);
    add_means(body, linear(fields.membrane_stress.data() + first), values[2]);
    add_means(body, linear(fields.von_mises.data() + first), values[3]);
  }
  add_solid_values(state, fields, values);
  for (const Floats& of_elements : element_values(fields)) {
    const auto [name, components, of_cells, of_tetrahedra] = layout_[values.size()];
    Floats& all = values.emplace_back();
    all.reserve(components * cells());
    if (of_tetrahedra) {
      all.assign(components * triangles(), no_value);
      all.insert(all.end(), of_elements.begin(), of_elements.end());
      continue;
    }
    for (const std::size_t element : element_of_cell_) {
      const auto first = of_elements.begin() + components * element;
      all.insert(all.end(), first, first + components);
    }
    all.resize(components * cells(), no_value);
  }
  TUNICA_ASSERT(values.size() == layout_.size());
  return values;
}

void ResultGrid::add_solid_values(const State& state, const ElementFields& fields,
                                  std::vector<std::vector<float>>& values) const {
  for (std::size_t v = model_.first_node(model_.shells.size()); v < model_.node_count(); ++v) {
    add(values[0], state.displacement[v]);
    add(values[1], state.rotation[v]);
    add(values[2], fields.membrane_stress[v]);
    add(values[3], fields.von_mises[v]);
  }
}

Floats ResultGrid::at_points(const std::vector<double>& of_nodes) const {
  TUNICA_ASSERT(of_nodes.size() == model_.node_count());
  Floats values;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const Body& body = bodies_[b];
    const auto& triangles = model_.shells[b].mesh.triangles;
    add_means(
        body,
        [&](std::size_t v) {
          return between(triangles[body.surface.vertex_shell[v]], body.surface.barycentric[v],
                         of_nodes.data() + model_.first_node(b));
        },
        values);
  }
  for (std::size_t s = 0; s < model_.solids.size(); ++s) {
    const std::size_t first = model_.first_node(model_.shells.size() + s);
    for (std::size_t v = 0; v < model_.solids[s].mesh.vertices.size(); ++v) {
      add(values, of_nodes[first + v]);
    }
  }
  return values;
}

std::pair<TriangleMesh, std::vector<double>> ResultGrid::moved_shells(const std::vector<Floats>& values) const {
  const auto field = [&](std::string_view name) {
    const auto found = std::ranges::find(layout_, name, [](const GridField& one) { return one.name; });
    TUNICA_ASSERT(found != layout_.end());
    return std::cref(values[narrow<std::size_t>(found - layout_.begin())]);
  };
  const Floats& moved = field("displacement");
  const Floats& stress = field("membrane_stress");
  std::vector<Index> number(points(), narrow<Index>(max_index));  // solids have points, too
  std::pair<TriangleMesh, std::vector<double>> shells;
  auto& [mesh, of_vertex] = shells;
  for (std::size_t t = 0; t < triangles(); ++t) {
    std::array<Index, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto point = narrow<std::size_t>(connectivity_[3 * t + k]);
      if (number[point] == max_index) {
        number[point] = narrow<Index>(mesh.vertices.size());
        const auto at = [&](std::size_t axis) { return coordinates_[3 * point + axis] + moved[3 * point + axis]; };
        mesh.vertices.emplace_back(at(0), at(1), at(2));
        of_vertex.push_back(stress[point]);
      }
      corners[k] = number[point];
    }
    mesh.triangles.push_back(corners);
  }
  return shells;
}

std::vector<std::array<std::size_t, 2>> ResultGrid::shell_edges() const {
  std::vector<std::array<std::size_t, 2>> edges;
  std::size_t first = 0;
  for (const Body& body : bodies_) {
    for (const auto& [from, to] : patch_edges(body.surface)) {
      edges.push_back({first + body.point[from], first + body.point[to]});
    }
    first += body.points;
  }
  return edges;
}

std::vector<std::vector<float>> ResultGrid::element_values(const ElementFields& fields) const {
  std::vector<Floats> values;
  const auto put = [&](const auto& list) {
    const GridField& field = layout_[point_fields.size() + values.size()];
    TUNICA_ASSERT(list.size() == (field.of_tetrahedra ? tetrahedra() : elements_));
    values.push_back(flat(list));
  };
  if (!model_.shells.empty()) {
    put(fields.pressure);
    put(fields.von_mises_top);
    put(fields.von_mises_bottom);
    put(fields.membrane_von_mises);
    put(fields.tension);
    put(fields.membrane_force);
    put(fields.bending_moment);
    put(fields.principal_strain_top);
    put(fields.principal_strain_bottom);
  }
  if (!model_.solids.empty()) {
    put(fields.solid_von_mises);
    put(fields.solid_pressure);
  }
  return values;
}

}  // namespace tunica
