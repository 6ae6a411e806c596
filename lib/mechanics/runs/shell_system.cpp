#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tunica {

ChangingLaw& ShellSystem::law() const {
  static ChangingLaw smooth;
  return contact ? *contact : smooth;
}

Configuration reference_configuration(const ShellSystem& system) {
  Configuration configuration = Configuration::at_rest(system.node_count());
  configuration.pressure.assign(system.solids.empty() ? 0 : system.node_count(), 0.0);
  return configuration;
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

void evaluate(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) {
  const Eigen::Index size = first_freedom(system.node_count());
  for (VectorX* sum : {&forces.internal, &forces.external, &forces.inertia}) {
    sum->setZero(size);
  }
  forces.energy = forces.noise = 0;
  if (tangent != nullptr) {
    std::fill(tangent->values.begin(), tangent->values.end(), 0.0);
  }
  bool valid = true;
  for (const auto& term : system.terms) {
    valid = term->add(system, at, forces, tangent) && valid;
  }
  forces.valid = valid && forces.internal.allFinite() && forces.external.allFinite();
}

void linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) {
  std::fill(matrix.values.begin(), matrix.values.end(), 0.0);
  for (const auto& term : system.terms) {
    term->add_linear_stiffness(system, matrix);
  }
}

void linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) {
  forces.setZero(first_freedom(system.node_count()));
  for (const auto& term : system.terms) {
    term->add_linear_forces(system, displacement, forces);
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

ShellMesh deformed_mesh(const ShellSystem& system, const Configuration& configuration, std::size_t body) {
  const Model& model = *system.model;
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

std::optional<double> enclosed_volume(const ShellSystem& system, const Configuration& configuration) {
  const Model& model = *system.model;
  double volume = 0;
  for (std::size_t body = 0; body < model.shells.size(); ++body) {
    try {
      volume += curved_volume(deformed_mesh(system, configuration, body));
    } catch (const InputError&) {
      return std::nullopt;  // open
    }
  }
  return model.shells.empty() ? std::nullopt : std::optional(volume);
}

}  // namespace tunica
