#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"
#include "tunica/mechanics/model/model.hpp"

namespace tunica {

/// What moves, 6 per node: displacements and spins about world axes.
struct Rates {
  VectorX velocity;      ///< mm/s, rad/s
  VectorX acceleration;  ///< mm/s^2, rad/s^2: of the equation of motion
  VectorX auxiliary;     ///< the acceleration that the generalised-alpha recursion carries, delayed by part of a step

  static Rates zero(Eigen::Index size) { return {VectorX::Zero(size), VectorX::Zero(size), VectorX::Zero(size)}; }
};

/// A one-step scheme that knows the rates at the end of a step from the change of the configuration over it:
/// displacements, and the vector of the rotation from the start to the end. The equation of motion holds at the end.
///
/// Backward Euler: velocity = change / h, acceleration = change of velocity / h. First order; damps everything whose
/// period is not much longer than the step.
/// Generalised-alpha on the rotation group: second order, unconditionally stable in linear dynamics; per step it keeps
/// `spectral_radius` of the amplitude of what is too fast for the step: 1 damps nothing, 0 wipes it out at once.
/// Source: Chung, Hulbert 1993; Bruls, Cardona 2010 and Arnold, Bruls 2007 for the recursion on Lie groups.
class TimeScheme {
public:
  explicit TimeScheme(const DynamicRun& run);

  /// Rates at the end of a step of `length` seconds. Held freedoms follow their prescribed motion by differences.
  void end_rates(double length, const std::vector<bool>& held, const Rates& start, const VectorX& change,
                 Rates& end) const;

  /// Derivatives of the end's velocity (1/s) and acceleration (1/s^2) by the change.
  [[nodiscard]] double velocity_factor(double length) const;
  [[nodiscard]] double acceleration_factor(double length) const;

  /// Estimate of what one step adds to the error of displacements and rotations: the first term of the change that the
  /// scheme leaves out. Source: Zienkiewicz, Xie 1991.
  [[nodiscard]] VectorX local_error(double length, const Rates& start, const Rates& end) const;
  /// The local error falls with this power of the step.
  [[nodiscard]] double local_order() const { return euler_ ? 2 : 3; }

  [[nodiscard]] bool second_order() const { return !euler_; }

private:
  bool euler_ = true;
  double alpha_m_ = 0;
  double alpha_f_ = 0;
  double beta_ = 1;
  double gamma_ = 1;
};

}  // namespace tunica
