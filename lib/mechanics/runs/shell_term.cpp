#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/elements/element_lanes.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/runs/detail/loads.hpp"
#include "tunica/mechanics/runs/detail/terms.hpp"

#include <Eigen/Dense>

#include <atomic>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t grain = 16;  // batches

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

}  // namespace

bool ShellTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  const std::vector<double> pressure = follower_pressures(system, at.factors, false);
  const Configuration& configuration = at.configuration;
  const ViscousState viscous = at.movement == nullptr ? ViscousState() : at.movement->viscous;
  const bool is_predicted = at.predicted != nullptr && !at.predicted->empty();
  std::atomic<bool> valid{true};
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
        if (is_predicted) {
          set_lanes(
              expected, [&](std::size_t l) -> const auto& { return (*at.predicted)[batch.elements[l]]; });
        }
        const LaneMask whole =
            corotational_response(elements, motion, damping, response, tangent == nullptr ? nullptr : &stiffness,
                                  is_predicted ? &expected : nullptr);
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
  forces.energy += std::accumulate(energies.begin(), energies.end(), 0.0);
  return valid;
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

void ShellTerm::add_linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) const {
  for (const std::vector<Batch>& colour : system.colours) {
    parallel_for_blocks(colour.size(), grain, [&](std::size_t begin, std::size_t end) {
      ElementLanes elements;
      for (std::size_t b = begin; b < end; ++b) {
        gather(members(system, colour[b]), elements);
        scatter(system, colour[b], linear_stiffness(elements), matrix);
      }
    });
  }
}

void ShellTerm::add_linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) const {
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
}

double ShellTerm::energy(const ShellSystem& system, const Configuration& configuration) const {
  double sum = 0;
  for (const ShellElement& element : system.elements) {
    CornerMotion motion;
    for (int k = 0; k < 3; ++k) {
      const Index node = element.nodes[k];
      motion.displacement.col(k) = configuration.displacement[node];
      motion.rotation[k] = configuration.rotation[node].toRotationMatrix();
    }
    ElementState d;
    if (deformation(element, motion, d)) {
      sum += strain_energy(element, d);
    }
  }
  return sum;
}

std::array<double, 2> ShellTerm::squared_stiffness(const ShellSystem& system) const {
  std::array<double, 2> sums{};
  for (const ShellElement& element : system.elements) {
    add_squares(linear_stiffness(element), 6, system.length, sums);
  }
  return sums;
}

}  // namespace tunica
