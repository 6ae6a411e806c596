#include "tunica/mechanics/runs/detail/layers.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/mechanics/model/wall.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <map>
#include <optional>

namespace tunica {
namespace {

/// The shells that are welded upon each other by whole triangles, as one plate of several layers.
class Layers {
public:
  explicit Layers(const ShellSystem& system)
      : system_(system), joined_(system.model->shells.size()), welded_(system.elements.size(), 0) {
    const std::map<std::pair<std::size_t, std::size_t>, double> distances = weld();
    std::vector<std::optional<double>> height(system.model->shells.size());  // over the first of a group
    for (std::size_t b = 0; b < height.size(); ++b) {
      if (joined_.root(b) == b) {
        height[b] = 0;
      }
    }
    for (std::size_t round = 0; round < height.size(); ++round) {
      for (const auto& [bodies, distance] : distances) {
        auto &upper = height[bodies.first], &lower = height[bodies.second];
        if (!upper && lower) {
          upper = *lower + distance;
        } else if (upper && !lower) {
          lower = *upper - distance;
        }
      }
    }
    sums_.resize(height.size());
    for (std::size_t e = 0; e < welded_.size(); ++e) {
      if (welded_[e] != 0) {
        const ShellElement& element = system.elements[e];
        const double z = height[element.body].value_or(0), t = element.thickness;
        const double stretching = element.area * t * system.model->shells[element.body].material.young;
        Sums& sums = sums_[group_of(e)];
        sums.stretching += stretching;
        sums.first += stretching * z;
        sums.second += stretching * z * z;
        sums.own += stretching * t * t / 12;
      }
    }
  }

  [[nodiscard]] bool has(std::size_t element) const { return welded_[element] != 0; }
  [[nodiscard]] std::size_t group_of(std::size_t element) const { return joined_.root(system_.elements[element].body); }
  [[nodiscard]] std::size_t group_of_body(std::size_t body) const { return joined_.root(body); }
  /// What part of the layers' bending stiffness they have of their own, without their distance from the middle of all.
  [[nodiscard]] double own_share(std::size_t group) const {
    const Sums& s = sums_[group];
    return s.own / (s.own + s.second - s.first * s.first / s.stretching);
  }
  /// N mm: the energy of a strain of one.
  [[nodiscard]] double stretching(std::size_t group) const { return sums_[group].stretching; }

private:
  struct Sums {
    double stretching = 0, first = 0, second = 0, own = 0;
  };

  /// Marks shells and joins bodies. @return the mean distance of one body over the other
  std::map<std::pair<std::size_t, std::size_t>, double> weld() {
    std::vector<const Carried*> by_node(system_.node_count(), nullptr);
    for (const Carried& c : system_.carried) {
      by_node[c.node] = c.turns ? &c : nullptr;
    }
    std::map<std::pair<std::size_t, std::size_t>, std::pair<double, double>> sums;
    for (std::size_t e = 0; e < welded_.size(); ++e) {
      const ShellElement& element = system_.elements[e];
      if (!std::ranges::all_of(element.nodes, [&](Index node) { return by_node[node] != nullptr; })) {
        continue;
      }
      welded_[e] = 1;
      for (const Index node : element.nodes) {
        const Carried& c = *by_node[node];
        const SurfaceFace& face = system_.surfaces.faces[c.face];
        welded_[c.face] = 1;  // the surfaces begin with the shells, in their order
        joined_.join(element.body, face.body);
        auto& [sum, count] = sums[{element.body, face.body}];
        sum += c.offset.dot((face.normals[0] + face.normals[1] + face.normals[2]).normalized());
        count += 1;
      }
    }
    std::map<std::pair<std::size_t, std::size_t>, double> means;
    for (const auto& [bodies, sum] : sums) {
      means[bodies] = sum.first / sum.second;
    }
    return means;
  }

  const ShellSystem& system_;
  mutable DisjointSets<std::size_t> joined_;
  std::vector<char> welded_;
  std::vector<Sums> sums_;  // by group
};

}  // namespace

ShellEnergy shell_energy(const ShellElement& element, const Material& material, const TensorPair& own,
                         const std::array<TensorPair, 3>& corners) {
  const double t = element.thickness;
  const Mat3 of_force = element.area / (2 * t) * plane_stress(material).inverse();
  const Mat3 of_moment = 12 / (t * t) * of_force;
  const auto energy = [](const Mat3& compliance, const Vec3& force) { return force.dot(compliance * force); };
  ShellEnergy result{energy(of_force, own.force), energy(of_moment, own.moment)};
  TensorPair sum{Vec3::Zero(), Vec3::Zero()};
  const auto add_jumps = [&](const TensorPair& off) {
    result.force_jumps += energy(of_force, off.force) / 12;  // the mass matrix of linear functions has 1 / 6 and 1 / 12
    result.moment_jumps += energy(of_moment, off.moment) / 12;
  };
  for (const TensorPair& corner : corners) {
    const TensorPair off{corner.force - own.force, corner.moment - own.moment};
    add_jumps(off);
    sum = {sum.force + off.force, sum.moment + off.moment};
  }
  add_jumps(sum);
  return result;
}

std::vector<double> layer_errors(const ShellSystem& system, std::span<const TensorPair> shells,
                                 std::span<const std::array<TensorPair, 3>> corners) {
  const Model& model = *system.model;
  std::vector<double> errors(model.shells.size(), 0);
  if (system.carried.empty()) {
    return errors;
  }
  const Layers layers(system);
  std::vector<std::array<double, 2>> energies(model.shells.size(), {0, 0});  // of all, of the differences
  for (std::size_t e = 0; e < shells.size(); ++e) {
    if (!layers.has(e)) {
      continue;
    }
    const Material& material = model.shells[system.elements[e].body].material;
    const ShellEnergy energy = shell_energy(system.elements[e], material, shells[e], corners[e]);
    auto& [whole, jumps] = energies[layers.group_of(e)];
    whole += energy.stretching + energy.bending;
    jumps += energy.force_jumps;
  }
  for (std::size_t b = 0; b < errors.size(); ++b) {
    const std::size_t group = layers.group_of_body(b);
    const auto [whole, jumps] = energies[group];
    if (whole > layers.stretching(group) * least_strain * least_strain) {
      errors[b] = jumps / (layers.own_share(group) * whole);
    }
  }
  return errors;
}

}  // namespace tunica
