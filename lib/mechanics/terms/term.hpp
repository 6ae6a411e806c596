#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/elements/shell_element.hpp"
#include "tunica/mechanics/model/configuration.hpp"

#include <array>
#include <vector>

namespace tunica {

struct ShellSystem;

/// Damping of shells in proportion to their stiffness.
struct ViscousState {
  double factor = 0;                                    ///< beta / dt
  const std::vector<ElementState>* previous = nullptr;  ///< deformations at the start of the step
};

/// How the nodes move at the end of a step in time, 6 per node: displacements and spins about world axes.
struct Movement {
  const VectorX& change;  ///< since the start of the step: displacements and rotation vectors
  const VectorX& velocity;
  const VectorX& acceleration;
  double velocity_factor;      ///< 1/s, derivative of the velocity by the change
  double acceleration_factor;  ///< 1/s^2, likewise
  double mass_damping;         ///< 1/s
  ViscousState viscous;
};

struct Forces {
  VectorX internal;  ///< 6 per node: force, moment
  VectorX external;
  VectorX contact;   ///< what of `external` is contact; of size zero: nothing touches anything
  VectorX inertia;   ///< what moving takes, with damping by mass; zero at rest
  double noise = 0;  ///< N: norm of what round-off makes of these forces, beside round_off()
  double energy = 0;
  std::vector<ElementState> deformation;  ///< per shell element
  bool valid = false;                     ///< false: an element has collapsed or folded by more than the normals allow
};

/// Where terms are looked at.
struct Instant {
  const Configuration& configuration;
  const std::vector<double>& factors;                    ///< of the loads
  const std::vector<ElementState>* predicted = nullptr;  ///< as in corotational_response(), per element
  const Movement* movement = nullptr;                    ///< none at rest
};

/// A part of the balance: shells with their damping, solids, loads, beds, contact, inertia. What it acts on, elements
/// and surfaces, is the system's. What is tied is no term: nodes that others carry are eliminated (condense()).
class Term {
public:
  Term() = default;
  virtual ~Term() = default;
  Term(const Term&) = delete;
  Term& operator=(const Term&) = delete;

  /// Adds energy and forces, and d(internal + inertia - external)/d(displacement, spin) where `tangent` is given. The
  /// same to the bit whatever the number of threads. @return false where the configuration cannot be used
  virtual bool add(const ShellSystem& system, const Instant& at, Forces& forces, BlockMatrix* tangent) const = 0;

  /// Of the linear theory at the reference, without any load.
  virtual void add_linear_stiffness(const ShellSystem& /*system*/, BlockMatrix& /*matrix*/) const {}
  /// That stiffness times displacements and rotation vectors (6 per node), by stresses: see linear_forces().
  virtual void add_linear_forces(const ShellSystem& /*system*/, const VectorX& /*displacement*/,
                                 VectorX& /*forces*/) const {}
  /// mJ, without what damping takes.
  [[nodiscard]] virtual double energy(const ShellSystem& /*system*/, const Configuration& /*configuration*/) const {
    return 0;
  }
  /// Its scale, for round-off: the sums of the squares of its stiffness by displacements, (N/mm)^2, and by rotations,
  /// N^2, moments divided by the system's length.
  [[nodiscard]] virtual std::array<double, 2> squared_stiffness(const ShellSystem& /*system*/) const { return {0, 0}; }
  /// Whether it acts where an organ was imaged under pressure already.
  [[nodiscard]] virtual bool acts_in_image() const { return true; }
};

}  // namespace tunica
