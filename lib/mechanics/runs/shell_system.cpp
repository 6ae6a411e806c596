#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/elements/element_lanes.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/supports.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t grain = 16;  // batches
constexpr std::size_t solid_grain = 64;

double mean_thickness(const ShellBody& body, const std::array<Index, 3>& triangle) {
  if (body.thickness.size() == 1) {
    return body.thickness[0];
  }
  return (body.thickness[triangle[0]] + body.thickness[triangle[1]] + body.thickness[triangle[2]]) / 3;
}

/// Area-weighted mean of the facets' normals at every vertex.
std::vector<Vec3> facet_normals_at_vertices(const ShellMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3 n = (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    for (const Index v : t) {
      normals[v] += n;
    }
  }
  for (Vec3& n : normals) {
    n.normalize();
  }
  return normals;
}

void colour_elements(ShellSystem& system) {
  // Greedy: the smallest colour that no element around the three nodes has yet. 64 colours are plenty for a manifold
  // mesh of sane valence; a node of a higher valence opens further groups.
  std::vector<std::vector<bool>> taken(system.node_count());
  for (std::size_t e = 0; e < system.elements.size(); ++e) {
    std::size_t colour = 0;
    const auto is_taken = [&](std::size_t c) {
      return std::any_of(system.elements[e].nodes.begin(), system.elements[e].nodes.end(),
                         [&](Index v) { return c < taken[v].size() && taken[v][c]; });
    };
    while (is_taken(colour)) {
      ++colour;
    }
    for (const Index v : system.elements[e].nodes) {
      if (taken[v].size() <= colour) {
        taken[v].resize(colour + 1, false);
      }
      taken[v][colour] = true;
    }
    if (system.colours.size() <= colour) {
      system.colours.resize(colour + 1);
    }
    std::vector<Batch>& batches = system.colours[colour];
    if (batches.empty() || batches.back().count == lane_count ||
        system.elements[batches.back().elements[0]].curved != system.elements[e].curved) {
      batches.emplace_back();
      batches.back().elements.fill(narrow<Index>(e));
    }
    batches.back().elements[batches.back().count++] = narrow<Index>(e);
  }
}

void find_pieces(ShellSystem& system, const Model& model) {
  DisjointSets joined(system.node_count());
  for (const ShellElement& e : system.elements) {
    joined.join(e.nodes[0], e.nodes[1]);
    joined.join(e.nodes[0], e.nodes[2]);
  }
  std::vector<std::size_t> piece_of(system.node_count(), SIZE_MAX);
  for (const SolidElement& e : system.solids) {
    for (std::size_t k = 1; k < 4; ++k) {
      joined.join(e.nodes[0], e.nodes[k]);
    }
  }
  for (std::size_t body = 0; body < model.body_count(); ++body) {
    for (std::size_t i = model.first_node(body); i < model.first_node(body + 1); ++i) {
      if (system.used[i] == 0) {
        continue;
      }
      std::size_t& piece = piece_of[joined.root(narrow<Index>(i))];
      if (piece == SIZE_MAX) {
        piece = system.pieces.size();
        system.pieces.push_back({body, {}});
      }
      system.pieces[piece].nodes.push_back(narrow<Index>(i));
    }
  }
}

/// Greedy, as colour_elements().
void colour_solids(ShellSystem& system) {
  std::vector<std::vector<bool>> taken(system.node_count());
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    const auto& nodes = system.solids[e].nodes;
    std::size_t colour = 0;
    while (std::any_of(nodes.begin(), nodes.end(),
                       [&](Index v) { return colour < taken[v].size() && taken[v][colour]; })) {
      ++colour;
    }
    for (const Index v : nodes) {
      if (taken[v].size() <= colour) {
        taken[v].resize(colour + 1, false);
      }
      taken[v][colour] = true;
    }
    if (system.solid_colours.size() <= colour) {
      system.solid_colours.resize(colour + 1);
    }
    system.solid_colours[colour].push_back(narrow<Index>(e));
  }
}

std::array<Vec3, 3> reference_corners(const ShellElement& e) {
  return {e.from_centroid.col(0), e.from_centroid.col(1), e.from_centroid.col(2)};
}

void add_dead_pressure(const ShellSystem& system, std::size_t element, double value, DeadLoad& load) {
  const ShellElement& e = system.elements[element];
  Vector9 force;
  unit_pressure(reference_corners(e), system.heights[element], force, nullptr);
  for (int k = 0; k < 3; ++k) {
    load.force.segment<3>(first_freedom(e.nodes[k])) += value * force.segment<3>(3 * k);
  }
}

/// A force per area of fixed direction: its normal part works on the deflection of the cubic.
void add_area_load(const ShellSystem& system, std::size_t element, const Vec3& per_area, DeadLoad& load) {
  const ShellElement& e = system.elements[element];
  const Vec3 normal = e.axes.row(2).transpose();
  const double across = normal.dot(per_area);
  const Vec3 in_plane = (per_area - across * normal) * (e.area / 3);
  const auto corners = reference_corners(e);
  const PlateLoad plate = plate_load(corners);
  // The patch has more area than its facet.
  const double spread = 2 * e.area / (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm();
  for (std::size_t k = 0; k < 3; ++k) {
    load.force.segment<3>(first_freedom(e.nodes[k])) += in_plane + spread * across * plate.force[k] * normal;
    load.director[e.nodes[k]] += spread * across * normal * plate.director[k].transpose();
  }
}

Index used_node(const ShellSystem& system, const Model& model, std::size_t body, Index node) {
  const std::size_t global = model.first_node(body) + node;
  if (node >= model.vertices_of(body).size() || system.used[global] == 0) {
    throw InputError(fmt::format("{}: a load acts on node {}, which no element uses", model.name_of(body), node));
  }
  return narrow<Index>(global);
}

void add_edge_load(const ShellSystem& system, const Model& model, std::size_t body, const EdgeLoad& edge_load,
                   DeadLoad& load) {
  for (const auto& edge : edge_load.edges) {
    const Index a = used_node(system, model, body, edge[0]);
    const Index b = used_node(system, model, body, edge[1]);
    const double length = (system.reference[a] - system.reference[b]).norm();
    load.force.segment<3>(first_freedom(a)) += edge_load.per_length * (length / 2);
    load.force.segment<3>(first_freedom(b)) += edge_load.per_length * (length / 2);
  }
}

/// Pressure that keeps its direction, or a force per area, on the surface of a solid.
void add_solid_surface_load(const ShellSystem& system, const Load& load, DeadLoad& dead) {
  const auto* pressure = std::get_if<PressureLoad>(&load.kind);
  const auto* area = std::get_if<AreaLoad>(&load.kind);
  if (pressure == nullptr && area == nullptr) {
    return;
  }
  for (std::size_t f = system.surfaces.first[load.body]; f < system.surfaces.first[load.body + 1]; ++f) {
    const auto& v = system.surfaces.faces[f].nodes;
    const Vec3 twice =
        (system.reference[v[1]] - system.reference[v[0]]).cross(system.reference[v[2]] - system.reference[v[0]]);
    const Vec3 force =
        pressure != nullptr ? Vec3(pressure->value / 6 * twice) : Vec3(twice.norm() / 6 * area->per_area);
    for (const Index node : v) {
      dead.force.segment<3>(first_freedom(node)) += force;
    }
  }
}

void make_loads(ShellSystem& system, const Model& model) {
  system.dead.resize(model.loads.size());
  for (std::size_t l = 0; l < model.loads.size(); ++l) {
    const Load& load = model.loads[l];
    DeadLoad& dead = system.dead[l];
    const bool solid = model.is_solid(load.body);
    const std::size_t begin = solid ? 0 : system.first_element[load.body];
    const std::size_t end = solid ? 0 : system.first_element[load.body + 1];
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind); pressure != nullptr && pressure->follower) {
      system.follower_pressures.emplace_back(l, load.body);
      continue;
    }
    dead.force = VectorX::Zero(first_freedom(system.node_count()));
    if (solid) {
      add_solid_surface_load(system, load, dead);
    }
    if (std::holds_alternative<AreaLoad>(load.kind) && !solid) {
      dead.director.assign(system.node_count(), Mat3::Zero());
    }
    if (const auto* pressure = std::get_if<PressureLoad>(&load.kind)) {
      for (std::size_t e = begin; e < end; ++e) {
        add_dead_pressure(system, e, pressure->value, dead);
      }
    } else if (const auto* area = std::get_if<AreaLoad>(&load.kind)) {
      for (std::size_t e = begin; e < end; ++e) {
        add_area_load(system, e, area->per_area, dead);
      }
    } else if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      for (const Index node : force->nodes) {
        dead.force.segment<3>(first_freedom(used_node(system, model, load.body, node))) +=
            force->total / real(force->nodes.size());
      }
    } else if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
      for (const Index node : moment->nodes) {
        dead.force.segment<3>(first_freedom(used_node(system, model, load.body, node)) + 3) +=
            moment->total / real(moment->nodes.size());
      }
    } else if (const auto* edge = std::get_if<EdgeLoad>(&load.kind)) {
      add_edge_load(system, model, load.body, *edge, dead);
    } else if (const auto* gravity = std::get_if<GravityLoad>(&load.kind)) {
      for (std::size_t i = model.first_node(load.body); i < model.first_node(load.body + 1); ++i) {
        dead.force.segment<3>(first_freedom(i)) = system.mass[i] * gravity->acceleration;
      }
    }
  }
}

ElementGroup members(const ShellSystem& system, const Batch& batch) {
  ElementGroup group{};
  for (std::size_t k = 0; k < lane_count; ++k) {
    group[k] = &system.elements[batch.elements[k]];
  }
  return group;
}

MotionLanes corner_motion(const ElementGroup& elements, const Configuration& configuration) {
  MotionLanes motion;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto node = [&](std::size_t k) { return elements[k]->nodes[corner]; };
    LaneVec3 displacement;
    set_lanes(
        displacement, [&](std::size_t k) -> const auto& { return configuration.displacement[node(k)]; });
    motion.displacement.col(corner) = displacement;
    Eigen::Matrix<Lanes, 4, 1> coefficients;
    set_lanes(
        coefficients, [&](std::size_t k) -> const auto& { return configuration.rotation[node(k)].coeffs(); });
    const Eigen::Quaternion<Lanes> rotation(coefficients);
    motion.rotation[corner] = rotation.toRotationMatrix();
  }
  return motion;
}

LaneVector18 corner_freedoms(const ElementGroup& elements, const VectorX& freedoms) {
  LaneVector18 of_corners;
  for (int k = 0; k < 3; ++k) {
    const std::size_t corner = k;
    LaneVector6 of_corner;
    set_lanes(of_corner, [&](std::size_t l) { return freedoms.segment<6>(first_freedom(elements[l]->nodes[corner])); });
    of_corners.segment<6>(6 * k) = of_corner;
  }
  return of_corners;
}

/// Unit pressure on elements whose slopes do not count: on the facet and its patch's frozen height.
void push_facets(const ShellSystem& system, const Batch& batch, const MotionLanes& motion, LaneVector18& force,
                 LaneMatrix18* stiffness) {
  std::array<Vector18, lane_count> forces;
  std::array<Matrix18, lane_count> stiffnesses;
  for (std::size_t l = 0; l < lane_count; ++l) {
    const ShellElement& element = system.elements[batch.elements[l]];
    const Mat3 displacement = lane(motion.displacement, l);
    std::array<Vec3, 3> corners;
    for (int k = 0; k < 3; ++k) {
      corners[k] = element.from_centroid.col(k) + (displacement.col(k) - displacement.col(0));
    }
    Vector9 on_corners;
    Matrix9 between_corners;
    unit_pressure(corners, system.heights[batch.elements[l]], on_corners,
                  stiffness == nullptr ? nullptr : &between_corners);
    forces[l].setZero();
    stiffnesses[l].setZero();
    for (int i = 0; i < 3; ++i) {
      forces[l].segment<3>(6 * i) = on_corners.segment<3>(3 * i);
      for (int j = 0; stiffness != nullptr && j < 3; ++j) {
        stiffnesses[l].block<3, 3>(6 * i, 6 * j) = between_corners.block<3, 3>(3 * i, 3 * j);
      }
    }
  }
  set_lanes(
      force, [&](std::size_t l) -> const auto& { return forces[l]; });
  if (stiffness != nullptr) {
    set_lanes(
        *stiffness, [&](std::size_t l) -> const auto& { return stiffnesses[l]; });
  }
}

void scatter(const ShellSystem& system, const Batch& batch, const LaneMatrix18& matrices, BlockMatrix& target) {
  constexpr int width = narrow<int>(lane_count);
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      const std::size_t place = 3 * i + j;
      for (int first = 0; first < 36; first += width) {
        std::array<Lanes, lane_count> part;
        for (int k = 0; k < width; ++k) {
          part[k] = matrices(6 * i + (first + k) % 6, 6 * j + (first + k) / 6);
        }
        transpose(part);
        for (std::size_t l = 0; l < batch.count; ++l) {
          double* const values = target.values.data() + 36 * system.placement[batch.elements[l]][place] + first;
          (Lanes(values, simd::element_aligned) + part[l]).copy_to(values, simd::element_aligned);
        }
      }
    }
  }
}

void scatter(const ShellSystem& system, Index element, const Matrix16& matrix, BlockMatrix& target) {
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      target.block(system.solid_placement[element][4 * i + j]).topLeftCorner<4, 4>() +=
          matrix.block<4, 4>(4 * i, 4 * j);
    }
  }
}

void add_dead_loads(const ShellSystem& system, const Configuration& configuration, const std::vector<double>& factors,
                    VectorX& external, BlockMatrix* tangent) {
  for (std::size_t l = 0; l < system.dead.size(); ++l) {
    const DeadLoad& load = system.dead[l];
    const double factor = factors[l];
    if (load.force.size() == 0 || factor == 0) {
      continue;
    }
    external += factor * load.force;
    for (std::size_t i = 0; i < load.director.size(); ++i) {
      // Moment: sum of (R n) x g. With M = R n g' its spin derivative is M - trace(M).
      const Mat3 m = factor * (configuration.rotation[i] * load.director[i]);
      external.segment<3>(first_freedom(i) + 3) += Vec3(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0));
      if (tangent != nullptr) {
        auto block = tangent->block(tangent->find(narrow<Index>(i), narrow<Index>(i)));
        block.block<3, 3>(3, 3) += m.trace() * Mat3::Identity() - m;
      }
    }
  }
}

/// The solids: forces, energy and tangent.
void evaluate_solids(const ShellSystem& system, const Configuration& configuration, Forces& forces,
                     BlockMatrix* tangent, std::atomic<bool>& valid) {
  std::vector<double> energies(system.solids.size());
  for (const std::vector<Index>& colour : system.solid_colours) {
    parallel_for_blocks(colour.size(), solid_grain, [&](std::size_t begin, std::size_t end) {
      SolidResponse response;
      Matrix16 stiffness;
      for (std::size_t c = begin; c < end; ++c) {
        const SolidElement& element = system.solids[colour[c]];
        if (!solid_response(element, corner_motion(element, configuration), response,
                            tangent == nullptr ? nullptr : &stiffness)) {
          valid = false;
          continue;
        }
        energies[colour[c]] = response.energy;
        for (int k = 0; k < 4; ++k) {
          forces.internal.segment<4>(first_freedom(element.nodes[k])) += response.force.segment<4>(4 * k);
        }
        if (tangent != nullptr) {
          scatter(system, colour[c], stiffness, *tangent);
        }
      }
    });
  }
  forces.energy += std::accumulate(energies.begin(), energies.end(), 0.0);
}

/// Follower pressure on the surfaces of solids.
void push_solids(const ShellSystem& system, const Configuration& configuration, const std::vector<double>& pressure,
                 VectorX& external, BlockMatrix* tangent) {
  for (std::size_t body = system.first_element.size() - 1; body < pressure.size(); ++body) {
    if (pressure[body] == 0) {
      continue;
    }
    for (std::size_t f = system.surfaces.first[body]; f < system.surfaces.first[body + 1]; ++f) {
      const auto& v = system.surfaces.faces[f].nodes;
      std::array<Vec3, 3> corners;
      for (std::size_t k = 0; k < 3; ++k) {
        corners[k] = system.reference[v[k]] + configuration.displacement[v[k]];
      }
      Vector9 force;
      Matrix9 stiffness;
      unit_pressure(corners, {}, force, tangent == nullptr ? nullptr : &stiffness);
      for (int i = 0; i < 3; ++i) {
        external.segment<3>(first_freedom(v[i])) += pressure[body] * force.segment<3>(3 * i);
        for (int j = 0; tangent != nullptr && j < 3; ++j) {
          tangent->block(tangent->find(v[i], v[j])).block<3, 3>(0, 0) -=
              pressure[body] * stiffness.block<3, 3>(3 * i, 3 * j);
        }
      }
    }
  }
}

/// Per body, MPa.
std::vector<double> follower_pressures(const ShellSystem& system, const Model& model,
                                       const std::vector<double>& factors) {
  std::vector<double> pressure(model.body_count(), 0);
  for (const auto& [load, body] : system.follower_pressures) {
    pressure[body] += factors[load] * std::get<PressureLoad>(model.loads[load].kind).value;
  }
  return pressure;
}

/// What round_off() needs. The element matrices themselves, not E t: those of a sliver are larger by the square of its
/// edge over its height, and so is the noise that one unit in the last place of a rotation makes there.
void add_stiffness_norms(ShellSystem& system) {
  double translation = 0;
  double rotation = 0;
  for (const ShellElement& element : system.elements) {
    const Matrix18 stiffness = linear_stiffness(element);
    for (int row = 0; row < 18; ++row) {
      for (int column = 0; column < 18; ++column) {
        const double entry = stiffness(row, column) / (row % 6 < 3 ? 1 : system.length);
        (column % 6 < 3 ? translation : rotation) += entry * entry;
      }
    }
  }
  for (const SolidElement& element : system.solids) {
    const Matrix16 stiffness = linear_stiffness(element);
    for (int row = 0; row < 16; ++row) {
      for (int column = 0; column < 16; ++column) {
        const double entry = stiffness(row, column) / (row % 4 < 3 ? 1 : system.length);
        (column % 4 < 3 ? translation : rotation) += entry * entry;
      }
    }
  }
  system.translation_stiffness = std::sqrt(translation);
  system.rotation_stiffness = std::sqrt(rotation);
}

}  // namespace

void stiffen_short_waves(ShellSystem& system) {
  for (ShellElement& element : system.elements) {
    element.skewing = element.short_waves;
  }
}

bool has_soft_waves(const ShellSystem& system) {
  return std::any_of(system.elements.begin(), system.elements.end(),
                     [](const ShellElement& element) { return element.thinness > 3; });
}

namespace {

void add_solids(ShellSystem& system, const Model& model, double& edges) {
  system.first_solid_node = system.reference.size();
  for (std::size_t s = 0; s < model.solids.size(); ++s) {
    const SolidBody& body = model.solids[s];
    const std::size_t number = model.shells.size() + s;
    const auto offset = narrow<Index>(model.first_node(number));
    system.reference.insert(system.reference.end(), body.mesh.vertices.begin(), body.mesh.vertices.end());
    for (const auto& v : body.mesh.tetrahedra) {
      Corners4 corners;
      for (int k = 0; k < 4; ++k) {
        corners.col(k) = body.mesh.vertices[v[k]];
      }
      SolidElement element = make_solid_element(corners, body.material, body.law);
      element.body = number;
      for (int k = 0; k < 4; ++k) {
        element.nodes[k] = v[k] + offset;
        system.used[element.nodes[k]] = 1;
        for (int l = 0; l < k; ++l) {
          edges += (corners.col(k) - corners.col(l)).norm();
        }
      }
      system.solids.push_back(element);
    }
  }
}

}  // namespace

void make_pattern(ShellSystem& system, const std::vector<std::array<Index, 2>>& pairs) {
  std::vector<std::vector<Index>> neighbours(system.node_count());
  const auto join = [&](const auto& nodes) {
    for (const Index i : nodes) {
      for (const Index j : nodes) {
        neighbours[i].push_back(j);
      }
    }
  };
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    neighbours[i].push_back(narrow<Index>(i));
  }
  for (const ShellElement& e : system.elements) {
    join(e.nodes);
  }
  for (const SolidElement& e : system.solids) {
    join(e.nodes);
  }
  for (const auto& pair : pairs) {
    join(pair);
  }
  for (std::vector<Index>& of_node : neighbours) {
    std::sort(of_node.begin(), of_node.end());
    of_node.erase(std::unique(of_node.begin(), of_node.end()), of_node.end());
  }
  add_carried_pairs(system.carried, neighbours);
  system.pattern = make_block_matrix(neighbours);
  const auto place = [&](const auto& nodes, auto& placement) {
    const std::size_t count = nodes.size();
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = 0; j < count; ++j) {
        placement[count * i + j] = system.pattern.find(nodes[i], nodes[j]);
      }
    }
  };
  system.placement.resize(system.elements.size());
  for (std::size_t e = 0; e < system.elements.size(); ++e) {
    place(system.elements[e].nodes, system.placement[e]);
  }
  system.solid_placement.resize(system.solids.size());
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    place(system.solids[e].nodes, system.solid_placement[e]);
  }
}

ShellSystem make_system(const Model& model) {
  ShellSystem system;
  const std::size_t nodes = model.node_count();
  system.reference.reserve(nodes);
  system.used.assign(nodes, 0);
  system.first_element.push_back(0);
  double edges = 0;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellBody& body = model.shells[b];
    const auto offset = narrow<Index>(model.first_node(b));
    system.reference.insert(system.reference.end(), body.mesh.vertices.begin(), body.mesh.vertices.end());
    const std::vector<Vec3> at_vertices = facet_normals_at_vertices(body.mesh);
    const bool curved = body.curved && body.rest == Rest::curved;
    for (std::size_t t = 0; t < body.mesh.triangles.size(); ++t) {
      const auto& v = body.mesh.triangles[t];
      const std::array<Vec3, 3> corners{body.mesh.vertices[v[0]], body.mesh.vertices[v[1]], body.mesh.vertices[v[2]]};
      const Vec3 facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
      const double thickness = mean_thickness(body, v);
      ShellSurface surface;
      surface.curved = curved && body.membrane == Membrane::adapt;
      std::array<Vec3, 3> bulge;  // the normals that tell how far the shell bulges over an edge
      for (std::size_t k = 0; k < 3; ++k) {
        surface.normals[k] = curved ? body.mesh.normal(t, k) : facet;
        bulge[k] = curved ? surface.normals[k] : at_vertices[v[k]];
      }
      const double scale = body.membrane == Membrane::adapt ? adapted_scale(corners, bulge, thickness) : 1;
      ShellElement element =
          make_shell_element(corners, surface, body.material, thickness, body.membrane, body.bending, scale);
      element.body = b;
      for (std::size_t k = 0; k < 3; ++k) {
        element.nodes[k] = v[k] + offset;
        system.used[element.nodes[k]] = 1;
        edges += (corners[(k + 1) % 3] - corners[k]).norm();
      }
      system.normals.push_back(surface.normals);
      system.heights.push_back(patch_height(corners, surface.normals));
      system.elements.push_back(element);
    }
    system.first_element.push_back(system.elements.size());
  }
  add_solids(system, model, edges);
  system.length = edges / real(std::max<std::size_t>(1, 3 * system.elements.size() + 6 * system.solids.size()));
  add_stiffness_norms(system);
  if (!model.solids.empty() || !model.attachments.empty() || !model.contacts.empty()) {
    system.surfaces = surface_faces(model);
  }
  system.carried = carried_nodes(model, system.surfaces, system.reference);
  if (!model.contacts.empty()) {
    system.contact = std::make_shared<ContactSystem>(model, system.surfaces, system.reference);
  }

  make_pattern(system, {});
  colour_elements(system);
  colour_solids(system);
  find_pieces(system, model);

  system.area = VectorX::Zero(nodes);
  system.mass = system.area;
  system.inertia = system.area;
  for (const ShellElement& e : system.elements) {
    const double mass = model.shells[e.body].material.density.value_or(0) * e.thickness * e.area / 3;
    for (const Index node : e.nodes) {
      system.area[node] += e.area / 3;
      system.mass[node] += mass;
      system.inertia[node] += mass * e.thickness * e.thickness / 12;
    }
  }
  for (const SolidElement& e : system.solids) {
    const double density = model.solids[e.body - model.shells.size()].material.density.value_or(0);
    for (const Index node : e.nodes) {
      system.mass[node] += density * e.volume / 4;
    }
  }
  make_loads(system, model);
  make_supports(system, model);
  return system;
}

Configuration reference_configuration(const ShellSystem& system) {
  Configuration configuration = Configuration::at_rest(system.node_count());
  configuration.pressure.assign(system.solids.empty() ? 0 : system.node_count(), 0.0);
  return configuration;
}

SolidMotion corner_motion(const SolidElement& element, const Configuration& configuration) {
  SolidMotion motion;
  for (int k = 0; k < 4; ++k) {
    motion.displacement.col(k) = configuration.displacement[element.nodes[k]];
    motion.pressure[k] = configuration.pressure[element.nodes[k]];
  }
  return motion;
}

void condense(const ShellSystem& system, const Configuration& configuration, VectorX& unbalanced,
              BlockMatrix* tangent) {
  if (!system.carried.empty()) {
    unbalanced = -unbalanced;
    condense(system.carried, system.surfaces, system.reference, configuration, unbalanced, tangent);
    unbalanced = -unbalanced;
  }
}

void advance_configuration(const ShellSystem& system, const VectorX& increment, Configuration& configuration) {
  for (std::size_t i = 0; i < configuration.displacement.size(); ++i) {
    configuration.displacement[i] += increment.segment<3>(first_freedom(i));
    if (i >= system.first_solid_node) {
      configuration.pressure[i] += increment[first_freedom(i) + 3];
      continue;
    }
    const Vec3 spin = increment.segment<3>(first_freedom(i) + 3);
    if (spin != Vec3::Zero()) {
      configuration.rotation[i] = (exponential(spin) * configuration.rotation[i]).normalized();
    }
  }
  place_carried(system.carried, system.surfaces, system.reference, configuration);
}

double factor_of(const Ramp& ramp, bool is_static, double time) {
  return is_static && ramp.points.empty() ? time : ramp.at(time);
}

std::vector<double> load_factors(const Model& model, bool is_static, double time) {
  std::vector<double> factors;
  for (const Load& load : model.loads) {
    factors.push_back(factor_of(load.ramp, is_static, time));
  }
  return factors;
}

std::vector<ElementState> predicted_deformations(const ShellSystem& system, const Configuration& configuration,
                                                 const VectorX& increment) {
  std::vector<ElementState> predicted(system.elements.size());
  for (const std::vector<Batch>& colour : system.colours) {
    parallel_for_blocks(colour.size(), grain, [&](std::size_t begin, std::size_t end) {
      ElementLanes elements;
      for (std::size_t b = begin; b < end; ++b) {
        const ElementGroup group = members(system, colour[b]);
        gather(group, elements);
        const LaneState state =
            predicted_deformation(elements, corner_motion(group, configuration), corner_freedoms(group, increment));
        for (std::size_t l = 0; l < colour[b].count; ++l) {
          predicted[colour[b].elements[l]] = lane(state, l);
        }
      }
    });
  }
  return predicted;
}

namespace {

void evaluate_shells(const ShellSystem& system, const Configuration& configuration, const std::vector<double>& pressure,
                     const ViscousState& viscous, const std::vector<ElementState>& predicted, Forces& forces,
                     BlockMatrix* tangent, std::atomic<bool>& valid) {
  forces.deformation.resize(system.elements.size());
  std::vector<double> energies(system.elements.size());
  for (const std::vector<Batch>& colour : system.colours) {
    parallel_for_blocks(colour.size(), grain, [&](std::size_t begin, std::size_t end) {
      ElementLanes elements;
      ResponseLanes response;
      ViscousLanes damping;
      LaneMatrix18 stiffness, push_stiffness;
      LaneVector18 pushed;
      for (std::size_t b = begin; b < end; ++b) {
        const Batch& batch = colour[b];
        const ElementGroup group = members(system, batch);
        gather(group, elements);
        const MotionLanes motion = corner_motion(group, configuration);
        damping.factor = viscous.previous == nullptr ? 0 : viscous.factor;
        if (damping.factor > 0) {
          set_lanes(
              damping.previous, [&](std::size_t l) -> const auto& { return (*viscous.previous)[batch.elements[l]]; });
        }
        LaneState expected;
        if (!predicted.empty()) {
          set_lanes(
              expected, [&](std::size_t l) -> const auto& { return predicted[batch.elements[l]]; });
        }
        const LaneMask whole =
            corotational_response(elements, motion, damping, response, tangent == nullptr ? nullptr : &stiffness,
                                  predicted.empty() ? nullptr : &expected);
        if (!all_of(whole)) {
          valid = false;
          continue;
        }
        Lanes p = Lanes([&](auto l) { return pressure[group[l]->body]; });
        const bool is_pushed = any_of(p != 0);
        if (is_pushed) {
          LaneMatrix18* const its_stiffness = tangent == nullptr ? nullptr : &push_stiffness;
          if (elements.curved) {
            unit_pressure(elements, motion, pushed, its_stiffness);
          } else {
            push_facets(system, batch, motion, pushed, its_stiffness);
          }
          pushed *= p;
        }
        for (std::size_t l = 0; l < batch.count; ++l) {
          const Index e = batch.elements[l];
          forces.deformation[e] = lane(response.deformation, l);
          energies[e] = response.energy[l];
          const Vector18 internal = lane(response.force, l);
          for (int k = 0; k < 3; ++k) {
            forces.internal.segment<6>(first_freedom(group[l]->nodes[k])) += internal.segment<6>(6 * k);
          }
          if (is_pushed) {
            const Vector18 external = lane(pushed, l);
            for (int k = 0; k < 3; ++k) {
              forces.external.segment<6>(first_freedom(group[l]->nodes[k])) += external.segment<6>(6 * k);
            }
          }
        }
        if (tangent != nullptr) {
          if (is_pushed) {
            stiffness -= p * push_stiffness;
          }
          scatter(system, batch, stiffness, *tangent);
        }
      }
    });
  }
  forces.energy = std::accumulate(energies.begin(), energies.end(), 0.0);
}

}  // namespace

void evaluate(const ShellSystem& system, const Model& model, const Configuration& configuration,
              const std::vector<double>& factors, const ViscousState& viscous, Forces& forces, BlockMatrix* tangent,
              const std::vector<ElementState>& predicted) {
  const Eigen::Index size = first_freedom(system.node_count());
  forces.internal.setZero(size);
  forces.external.setZero(size);
  if (tangent != nullptr) {
    std::fill(tangent->values.begin(), tangent->values.end(), 0.0);
  }
  const std::vector<double> pressure = follower_pressures(system, model, factors);
  std::atomic<bool> valid{true};
  evaluate_shells(system, configuration, pressure, viscous, predicted, forces, tangent, valid);
  if (!system.solids.empty()) {
    evaluate_solids(system, configuration, forces, tangent, valid);
    push_solids(system, configuration, pressure, forces.external, tangent);
  }
  add_dead_loads(system, configuration, factors, forces.external, tangent);
  if (system.contact) {
    valid = system.contact->add(configuration, forces.external, tangent) && valid;
  }
  forces.valid = valid && forces.internal.allFinite() && forces.external.allFinite();
}

void linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) {
  std::fill(matrix.values.begin(), matrix.values.end(), 0.0);
  for (const std::vector<Batch>& colour : system.colours) {
    parallel_for_blocks(colour.size(), grain, [&](std::size_t begin, std::size_t end) {
      ElementLanes elements;
      for (std::size_t b = begin; b < end; ++b) {
        gather(members(system, colour[b]), elements);
        scatter(system, colour[b], linear_stiffness(elements), matrix);
      }
    });
  }
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    scatter(system, narrow<Index>(e), linear_stiffness(system.solids[e]), matrix);
  }
}

void linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) {
  forces.setZero(first_freedom(system.node_count()));
  for (const std::vector<Batch>& colour : system.colours) {
    parallel_for_blocks(colour.size(), grain, [&](std::size_t begin, std::size_t end) {
      ElementLanes elements;
      for (std::size_t b = begin; b < end; ++b) {
        const ElementGroup group = members(system, colour[b]);
        gather(group, elements);
        const LaneVector18 force = linear_force(elements, corner_freedoms(group, displacement));
        for (std::size_t l = 0; l < colour[b].count; ++l) {
          const Vector18 one = lane(force, l);
          for (int k = 0; k < 3; ++k) {
            forces.segment<6>(first_freedom(group[l]->nodes[k])) += one.segment<6>(6 * k);
          }
        }
      }
    });
  }
  for (const SolidElement& element : system.solids) {
    Vector16 motion;
    for (int k = 0; k < 4; ++k) {
      motion.segment<4>(4 * k) = displacement.segment<4>(first_freedom(element.nodes[k]));
    }
    const Vector16 force = linear_stiffness(element) * motion;
    for (int k = 0; k < 4; ++k) {
      forces.segment<4>(first_freedom(element.nodes[k])) += force.segment<4>(4 * k);
    }
  }
}

VectorX lumped_masses(const ShellSystem& system) {
  VectorX mass(first_freedom(system.node_count()));
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    mass.segment<3>(first_freedom(i)).setConstant(system.mass[i]);
    mass.segment<3>(first_freedom(i) + 3).setConstant(system.inertia[i]);
  }
  return mass;
}

double longest_side(const ShellSystem& system) {
  Vec3 low = Vec3::Constant(infinity);
  Vec3 high = -low;
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    if (system.used[i] != 0) {
      low = low.cwiseMin(system.reference[i]);
      high = high.cwiseMax(system.reference[i]);
    }
  }
  return (high - low).maxCoeff();
}

double largest_rotation(const ShellSystem& system, const VectorX& freedoms) {
  double largest = 0;
  for (Eigen::Index i = 3; i < first_freedom(system.first_solid_node); i += 6) {
    largest = std::max(largest, freedoms.segment<3>(i).norm());
  }
  return largest;
}

double force_norm(const ShellSystem& system, const VectorX& force) {
  double sum = 0;
  for (std::size_t i = 0; i < system.node_count(); ++i) {
    sum += force.segment<3>(first_freedom(i)).squaredNorm() +
           force.segment<3>(first_freedom(i) + 3).squaredNorm() / (system.length * system.length);
  }
  return std::sqrt(sum);
}

double round_off(const ShellSystem& system, const Configuration& configuration) {
  double largest = 0;
  for (const Vec3& u : configuration.displacement) {
    largest = std::max(largest, u.squaredNorm());
  }
  return 4 * std::numeric_limits<double>::epsilon() *
         std::hypot(system.translation_stiffness * (system.length + std::sqrt(largest)), system.rotation_stiffness);
}

ShellMesh deformed_mesh(const ShellSystem& system, const Model& model, const Configuration& configuration,
                        std::size_t body) {
  ShellMesh mesh = model.shells[body].mesh;
  const std::size_t offset = model.first_node(body);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    mesh.vertices[i] += configuration.displacement[offset + i];
  }
  mesh.corner_normals.resize(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      mesh.corner_normals[t][k] =
          configuration.rotation[offset + mesh.triangles[t][k]] * system.normals[system.first_element[body] + t][k];
    }
  }
  return mesh;
}

std::optional<double> enclosed_volume(const ShellSystem& system, const Model& model,
                                      const Configuration& configuration) {
  double volume = 0;
  for (std::size_t body = 0; body < model.shells.size(); ++body) {
    try {
      volume += curved_volume(deformed_mesh(system, model, configuration, body));
    } catch (const InputError&) {
      return std::nullopt;  // open
    }
  }
  return model.shells.empty() ? std::nullopt : std::optional(volume);
}

void take_out_rigid_motion(const ShellSystem& system, const Piece& piece, Configuration& configuration) {
  double weight = 0;
  Vec3 centre = Vec3::Zero();
  for (const Index i : piece.nodes) {
    weight += system.area[i];
    centre += system.area[i] * system.reference[i];
  }
  centre /= weight;
  for (int iteration = 0; iteration < 30; ++iteration) {
    Vec3 shift = Vec3::Zero();
    Vec3 moment = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (const Index i : piece.nodes) {
      shift += system.area[i] / weight * configuration.displacement[i];
    }
    for (const Index i : piece.nodes) {
      const Vec3 arm = system.reference[i] - centre;
      const Vec3 now = arm + configuration.displacement[i] - shift;
      moment += system.area[i] * arm.cross(configuration.displacement[i] - shift);
      inertia += system.area[i] * (arm.dot(now) * Mat3::Identity() - now * arm.transpose());
    }
    const Vec3 turn = -inertia.partialPivLu().solve(moment);
    const Eigen::Quaterniond q = exponential(turn);
    // (q - 1) x, so that small displacements keep their digits.
    const auto change = [&](const Vec3& x) {
      const Vec3 t = 2 * q.vec().cross(x);
      return Vec3(q.w() * t + q.vec().cross(t));
    };
    for (const Index i : piece.nodes) {
      Vec3& u = configuration.displacement[i];
      u -= shift;
      u += change(system.reference[i] - centre + u);
      configuration.rotation[i] = (q * configuration.rotation[i]).normalized();
    }
    if (!(turn.norm() > 1e-14)) {
      break;
    }
  }
}

void take_out_linear_rigid_motion(const ShellSystem& system, const Model& model, VectorX& displacement) {
  for (const Piece& piece : system.pieces) {
    if (!held_by_rigid_motions(model, piece.body)) {
      continue;
    }
    double weight = 0;
    Vec3 centre = Vec3::Zero();
    Vec3 shift = Vec3::Zero();
    for (const Index i : piece.nodes) {
      weight += system.area[i];
      centre += system.area[i] * system.reference[i];
      shift += system.area[i] * displacement.segment<3>(first_freedom(i));
    }
    centre /= weight;
    shift /= weight;
    Vec3 moment = Vec3::Zero();
    Mat3 inertia = Mat3::Zero();
    for (const Index i : piece.nodes) {
      const Vec3 arm = system.reference[i] - centre;
      moment += system.area[i] * arm.cross(displacement.segment<3>(first_freedom(i)) - shift);
      inertia += system.area[i] * (arm.squaredNorm() * Mat3::Identity() - arm * arm.transpose());
    }
    const Vec3 turn = inertia.ldlt().solve(moment);
    for (const Index i : piece.nodes) {
      displacement.segment<3>(first_freedom(i)) -= shift + turn.cross(system.reference[i] - centre);
      displacement.segment<3>(first_freedom(i) + 3) -= turn;
    }
  }
}

}  // namespace tunica
