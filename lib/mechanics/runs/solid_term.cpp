#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/mechanics/elements/pressure.hpp"
#include "tunica/mechanics/runs/detail/loads.hpp"
#include "tunica/mechanics/runs/detail/terms.hpp"

#include <atomic>
#include <numeric>

namespace tunica {
namespace {

constexpr std::size_t solid_grain = 64;  // tetrahedra

void scatter(const ShellSystem& system, Index element, const Matrix16& matrix, BlockMatrix& target) {
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      target.block(system.solid_placement[element][4 * i + j]).topLeftCorner<4, 4>() +=
          matrix.block<4, 4>(4 * i, 4 * j);
    }
  }
}

}  // namespace

SolidMotion corner_motion(const SolidElement& element, const Configuration& configuration) {
  SolidMotion motion;
  for (int k = 0; k < 4; ++k) {
    motion.displacement.col(k) = configuration.displacement[element.nodes[k]];
    motion.pressure[k] = configuration.pressure[element.nodes[k]];
  }
  return motion;
}

bool SolidTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  std::atomic<bool> valid{true};
  const Configuration& configuration = at.configuration;
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
  return valid;
}

void SolidTerm::add_linear_stiffness(const ShellSystem& system, BlockMatrix& matrix) const {
  for (std::size_t e = 0; e < system.solids.size(); ++e) {
    scatter(system, narrow<Index>(e), linear_stiffness(system.solids[e]), matrix);
  }
}

void SolidTerm::add_linear_forces(const ShellSystem& system, const VectorX& displacement, VectorX& forces) const {
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
}

double SolidTerm::energy(const ShellSystem& system, const Configuration& configuration) const {
  double sum = 0;
  for (const SolidElement& element : system.solids) {
    SolidResponse response;
    if (solid_response(element, corner_motion(element, configuration), response, nullptr)) {
      sum += response.energy;
    }
  }
  return sum;
}

std::array<double, 2> SolidTerm::squared_stiffness(const ShellSystem& system) const {
  std::array<double, 2> sums{};
  for (const SolidElement& element : system.solids) {
    add_squares(linear_stiffness(element), 4, system.length, sums);
  }
  return sums;
}

bool SolidPressureTerm::add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const {
  const std::vector<double> pressure = follower_pressures(system, at.factors, true);
  const Configuration& configuration = at.configuration;
  VectorX& external = forces.external;
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
        tangent->block(tangent->find(v[i], v[j])).block<3, 3>(0, 0) -=
            pressure[f] * stiffness.block<3, 3>(3 * i, 3 * j);
      }
    }
  }
  return true;
}

}  // namespace tunica
