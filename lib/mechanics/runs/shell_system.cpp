#include "tunica/mechanics/runs/detail/shell_system.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/elements/element_lanes.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t grain = 16;  // batches
constexpr std::size_t solid_grain = 64;

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
    const double factor = load.begin + factors[l] * (load.end - load.begin);
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

/// Follower pressure on the surfaces of solids. @param pressure  per face, MPa; zero on the faces of shells
void push_solids(const ShellSystem& system, const Configuration& configuration, const std::vector<double>& pressure,
                 VectorX& external, BlockMatrix* tangent) {
  for (std::size_t f = 0; f < pressure.size(); ++f) {
    if (pressure[f] == 0) {
      continue;
    }
    const auto& v = system.surfaces.faces[f].nodes;
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = system.reference[v[k]] + configuration.displacement[v[k]];
    }
    Vector9 force;
    Matrix9 stiffness;
    unit_pressure(corners, {}, force, tangent == nullptr ? nullptr : &stiffness);
    for (int i = 0; i < 3; ++i) {
      external.segment<3>(first_freedom(v[i])) += pressure[f] * force.segment<3>(3 * i);
      for (int j = 0; tangent != nullptr && j < 3; ++j) {
        tangent->block(tangent->find(v[i], v[j])).block<3, 3>(0, 0) -= pressure[f] * stiffness.block<3, 3>(3 * i, 3 * j);
      }
    }
  }
}

/// MPa: per element, and per face of the solids' surfaces.
struct Pressures {
  std::vector<double> elements, faces;
};

Pressures follower_pressures(const ShellSystem& system, const Model& model, const std::vector<double>& factors) {
  Pressures pressures;
  pressures.elements.assign(system.elements.size(), 0);
  pressures.faces.assign(system.surfaces.faces.size(), 0);
  for (const FollowerPressure& follower : system.follower_pressures) {
    const double value = std::get<PressureLoad>(model.loads[follower.load].kind).at(factors[follower.load]);
    const bool solid = model.is_solid(follower.body);
    std::vector<double>& values = solid ? pressures.faces : pressures.elements;
    const std::vector<std::size_t>& first = solid ? system.surfaces.first : system.first_element;
    for (std::size_t k = first[follower.body]; k < first[follower.body + 1]; ++k) {
      values[k] += follower.on.empty() || follower.on[k - first[follower.body]] != 0 ? value : 0;
    }
  }
  return pressures;
}

}  // namespace

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
        Lanes p = Lanes([&](auto l) { return pressure[batch.elements[l]]; });
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
  const Pressures pressure = follower_pressures(system, model, factors);
  std::atomic<bool> valid{true};
  evaluate_shells(system, configuration, pressure.elements, viscous, predicted, forces, tangent, valid);
  if (!system.solids.empty()) {
    evaluate_solids(system, configuration, forces, tangent, valid);
    push_solids(system, configuration, pressure.faces, forces.external, tangent);
  }
  add_dead_loads(system, configuration, factors, forces.external, tangent);
  if (system.bed) {
    system.bed->add_forces(configuration.displacement, forces.internal);
    forces.energy += system.bed->energy(configuration.displacement);
    if (tangent != nullptr) {
      system.bed->add_stiffness(*tangent);
    }
  }
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
  if (system.bed) {
    system.bed->add_stiffness(matrix);
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
    const Vector16 force = linear_force(element, motion);
    for (int k = 0; k < 4; ++k) {
      forces.segment<4>(first_freedom(element.nodes[k])) += force.segment<4>(4 * k);
    }
  }
  if (system.bed) {
    system.bed->add_forces(displacement, forces);
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

}  // namespace tunica
