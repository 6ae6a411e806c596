#include "tunica/mechanics/runs/detail/loads.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/pressure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace tunica {
namespace {

std::array<Vec3, 3> reference_corners(const ShellElement& e) {
  return {e.from_centroid.col(0), e.from_centroid.col(1), e.from_centroid.col(2)};
}

/// A pressure of 1 MPa on a part of an element.
void add_dead_pressure(const ShellSystem& system, std::size_t element, double share, DeadLoad& load) {
  const ShellElement& e = system.elements[element];
  Vector9 force;
  unit_pressure(reference_corners(e), system.heights[element], force, nullptr);
  for (int k = 0; k < 3; ++k) {
    load.force.segment<3>(first_freedom(e.nodes[k])) += share * force.segment<3>(3 * k);
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

Index used_node(const ShellSystem& system, std::size_t body, Index node) {
  const Model& model = *system.model;
  const std::size_t global = model.first_node(body) + node;
  if (node >= model.vertices_of(body).size() || system.used[global] == 0) {
    throw InputError(fmt::format("{}: a load acts on node {}, which no element uses", model.name_of(body), node));
  }
  return narrow<Index>(global);
}

/// Of the cubic arc over a chord of unit length, by the slopes at its ends.
double arc_length(double first, double last) { return 1 + (2 * (first * first + last * last) - first * last) / 30; }

/// Half of the arc at each end, and its moment about the chord, as loaded edges keep their shape (keep_held_edges): of
/// a cubic arc the mean rise over its chord is length^2 / 12 x the difference of its slopes. On flat facets it works on
/// the bow that rotations of the ends make (MembraneStiffness::bow). So a wall under constant membrane stress is in
/// balance with its edge load.
void add_edge_load(const ShellSystem& system, std::size_t body, const EdgeLoad& edge_load, DeadLoad& load) {
  struct Side {
    double share = 0;
    std::vector<std::pair<std::size_t, std::size_t>> elements;  // and which of their edges
  };
  std::map<std::pair<Index, Index>, Side> sides;  // by their ends
  for (std::size_t i = 0; i < edge_load.edges.size(); ++i) {
    const Index a = used_node(system, body, edge_load.edges[i][0]);
    const Index b = used_node(system, body, edge_load.edges[i][1]);
    sides[std::minmax(a, b)].share += share_of(edge_load.shares, i);
  }
  for (std::size_t e = system.first_element[body]; e < system.first_element[body + 1]; ++e) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& nodes = system.elements[e].nodes;
      if (const auto side = sides.find(std::minmax(nodes[k], nodes[(k + 1) % 3])); side != sides.end()) {
        side->second.elements.emplace_back(e, k);
      }
    }
  }
  for (const auto& [ends, side] : sides) {
    if (side.elements.empty()) {
      throw InputError(fmt::format("{}: a load acts on an edge from node {} to {}, which no element has",
                                   system.model->name_of(body), ends.first - system.model->first_node(body),
                                   ends.second - system.model->first_node(body)));
    }
    for (const auto& [e, k] : side.elements) {
      const ShellElement& element = system.elements[e];
      const auto corners = reference_corners(element);
      const Index first = element.nodes[k], last = element.nodes[(k + 1) % 3];
      const Vec3 chord = corners[(k + 1) % 3] - corners[k];
      const double part = side.share / real(side.elements.size());
      const double length =
          chord.norm() * (element.curved ? arc_length(element.slopes[2 * k], element.slopes[2 * k + 1]) : 1);
      for (const Index node : {first, last}) {
        load.force.segment<3>(first_freedom(node)) += edge_load.per_length * (part * length / 2);
      }
      if (element.curved) {
        const Vec3 normal = element.axes.transpose() * element.edge_normals.col(k);
        const double under_arc = chord.squaredNorm() / 12 * (element.slopes[2 * k] - element.slopes[2 * k + 1]);
        const Mat3 arm = part * under_arc / 2 * normal * edge_load.per_length.transpose();
        load.director[first] += arm;
        load.director[last] += arm;
      }
      const Vec3 along = element.axes * chord.normalized();
      const Vec2 out(along.y(), -along.x());
      const double pull = (element.axes * edge_load.per_length).head<2>().dot(out);
      const double facet = (corners[1] - corners[0]).cross(corners[2] - corners[0]).norm() / 2;
      const Vec3 force(out.x() * out.x(), out.y() * out.y(), out.x() * out.y());  // the membrane force of a unit pull
      const Vec3 moment =
          part * facet * pull * element.bow.col(narrow<Eigen::Index>(k)).dot(force) * element.axes.row(2).transpose();
      load.force.segment<3>(first_freedom(last) + 3) += moment;
      load.force.segment<3>(first_freedom(first) + 3) -= moment;
    }
  }
}

/// Pressure of 1 MPa that keeps its direction, or a force per area, on the surface of a solid.
void add_solid_surface_load(const ShellSystem& system, const Load& load, DeadLoad& dead) {
  const auto* pressure = std::get_if<PressureLoad>(&load.kind);
  const auto* area = std::get_if<AreaLoad>(&load.kind);
  if (pressure == nullptr && area == nullptr) {
    return;
  }
  const std::size_t first = system.surfaces.first[load.body];
  for (std::size_t f = first; f < system.surfaces.first[load.body + 1]; ++f) {
    const double share = pressure != nullptr ? share_of(pressure->shares, f - first) : 1;
    const auto& v = system.surfaces.faces[f].nodes;
    const Vec3 twice =
        (system.reference[v[1]] - system.reference[v[0]]).cross(system.reference[v[2]] - system.reference[v[0]]);
    const Vec3 force = pressure != nullptr ? Vec3(share * twice / 6) : Vec3(twice.norm() / 6 * area->per_area);
    for (const Index node : v) {
      dead.force.segment<3>(first_freedom(node)) += force;
    }
  }
}

/// MPa, of the pressures that count, per shell element, or per face of the surfaces of solids.
template <typename Counts>
std::vector<double> summed(const ShellSystem& system, const std::vector<double>& factors, bool of_solids,
                           const Counts& counts) {
  const std::vector<std::size_t>& first = of_solids ? system.surfaces.first : system.first_element;
  std::vector<double> pressures(of_solids ? system.surfaces.faces.size() : system.elements.size(), 0);
  const std::vector<Load>& loads = system.model->loads;
  for (std::size_t l = 0; l < loads.size(); ++l) {
    const auto* const pressure = std::get_if<PressureLoad>(&loads[l].kind);
    if (pressure == nullptr || system.model->is_solid(loads[l].body) != of_solids || !counts(*pressure)) {
      continue;
    }
    const double value = pressure->at(factors[l]);
    const std::size_t begin = first[loads[l].body];
    for (std::size_t k = begin; k < first[loads[l].body + 1]; ++k) {
      pressures[k] += share_of(pressure->shares, k - begin) * value;
    }
  }
  return pressures;
}

}  // namespace

void make_loads(ShellSystem& system) {
  const Model& model = *system.model;
  system.dead.resize(model.loads.size());
  for (std::size_t l = 0; l < model.loads.size(); ++l) {
    const Load& load = model.loads[l];
    DeadLoad& dead = system.dead[l];
    const bool solid = model.is_solid(load.body);
    const std::size_t begin = solid ? 0 : system.first_element[load.body];
    const std::size_t end = solid ? 0 : system.first_element[load.body + 1];
    const auto* pressure = std::get_if<PressureLoad>(&load.kind);
    if (pressure != nullptr && pressure->follower) {
      continue;
    }
    dead.force = VectorX::Zero(first_freedom(system.node_count()));
    if (solid) {
      add_solid_surface_load(system, load, dead);
    }
    if ((std::holds_alternative<AreaLoad>(load.kind) || std::holds_alternative<EdgeLoad>(load.kind)) && !solid) {
      dead.director.assign(system.node_count(), Mat3::Zero());
    }
    if (pressure != nullptr) {
      dead.begin = pressure->at(0);
      dead.end = pressure->at(1);
      for (std::size_t e = begin; e < end; ++e) {
        add_dead_pressure(system, e, share_of(pressure->shares, e - begin), dead);
      }
    } else if (const auto* area = std::get_if<AreaLoad>(&load.kind)) {
      for (std::size_t e = begin; e < end; ++e) {
        add_area_load(system, e, area->per_area, dead);
      }
    } else if (const auto* force = std::get_if<ForceLoad>(&load.kind)) {
      for (const Index node : force->nodes) {
        dead.force.segment<3>(first_freedom(used_node(system, load.body, node))) +=
            force->total / real(force->nodes.size());
      }
    } else if (const auto* moment = std::get_if<MomentLoad>(&load.kind)) {
      for (const Index node : moment->nodes) {
        dead.force.segment<3>(first_freedom(used_node(system, load.body, node)) + 3) +=
            moment->total / real(moment->nodes.size());
      }
    } else if (const auto* edge = std::get_if<EdgeLoad>(&load.kind)) {
      add_edge_load(system, load.body, *edge, dead);
    } else if (const auto* gravity = std::get_if<GravityLoad>(&load.kind)) {
      for (std::size_t i = model.first_node(load.body); i < model.first_node(load.body + 1); ++i) {
        dead.force.segment<3>(first_freedom(i)) = system.mass[i] * gravity->acceleration;
      }
    }
  }
}

std::vector<double> follower_pressures(const ShellSystem& system, const std::vector<double>& factors, bool of_solids) {
  return summed(system, factors, of_solids, [](const PressureLoad& pressure) { return pressure.follower; });
}

std::vector<double> shell_pressures(const ShellSystem& system, const std::vector<double>& factors) {
  return summed(system, factors, false, [](const PressureLoad&) { return true; });
}

}  // namespace tunica
