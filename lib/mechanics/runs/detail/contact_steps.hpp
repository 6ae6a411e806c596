#pragma once

#include "tunica/mechanics/runs/detail/newton.hpp"

#include <memory>

namespace tunica {

/// Makes contact ready for a step of the rigid bodies: samples, pairs of nodes that may meet, and what follows from
/// them. Nothing where nothing touches.
void begin_contact(ShellSystem& system, const RunSettings& settings, double from, double to,
                   const Configuration& configuration, std::optional<TangentSolver>& solver, BlockMatrix& matrix);

/// A state that is kept.
void accept_contact(const ShellSystem& system, const Configuration& configuration);

/// Before a step of a motion: what is about to touch is to be stopped (ContactSystem::brace()).
/// @param velocity  mm/s, 6 per node; length  s, of the step
void brace_contact(const ShellSystem& system, const VectorX& velocity, double length);

/// Energy that contact takes and gives. What its barrier takes and gives back is stored. Of the rest, the work of rigid
/// bodies that move is brought in, and what friction takes is damped; where neither is, time integration loses it, or
/// gains from it.
class ContactWork {
public:
  explicit ContactWork(const ShellSystem& system);

  /// Forces at the end of a step on what moves, which are those at the start of the next; of size zero: nothing may
  /// touch.
  void keep(VectorX forces);

  struct Work {
    double brought = 0, damped = 0;  ///< mJ
  };
  /// Over a step that is accepted, by the mean of its ends. @param change  displacements and rotations
  Work over(const VectorX& change);

  [[nodiscard]] double stored() const { return stored_; }  ///< mJ
  [[nodiscard]] const VectorX& touching() const { return touching_; }
  /// @param touching  as it was at the end of the last step
  void recall(const VectorX& touching);

private:
  std::shared_ptr<ContactSystem> contact_;  ///< none where nothing may touch
  bool rubs_;                               ///< some contact has friction
  VectorX touched_, touching_;
  double stored_ = 0;
};

}  // namespace tunica
