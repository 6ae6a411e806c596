// mechanics/terms: what acts on a configuration, part by part, and what of it changes on the way.
#pragma once

#include "tunica/mechanics/algebra/block_matrix.hpp"

namespace tunica {

/// What changes its own law while one state is sought, as contact does: bodies that move within the step, barriers that
/// are hardened on the way, faces from one to the next of which forces jump. Newton's method knows of it only this. The
/// class itself is the law of smooth forces, which never change.
class ChangingLaw {
public:
  ChangingLaw() = default;
  virtual ~ChangingLaw() = default;
  ChangingLaw(const ChangingLaw&) = delete;
  ChangingLaw& operator=(const ChangingLaw&) = delete;

  [[nodiscard]] virtual bool may_change() const { return false; }
  /// Of the motion of bodies in the step, what is still to come: 0 to 1.
  [[nodiscard]] virtual double left() const { return 0; }
  virtual void set_left(double /*left*/) {}
  /// On the way. @return whether the law is another from here
  virtual bool harden() { return false; }
  /// At rest. @return whether the law is another from here, so that the state is none yet
  virtual bool sharpen() { return false; }
  /// Whether forces may jump.
  [[nodiscard]] virtual bool has_kinks() const { return false; }
  /// mm: the smallest distance over which the law's forces build up.
  [[nodiscard]] virtual double resolution() const { return 0; }
  /// Whether the tangent is not symmetric, so that its pivots say nothing about stability.
  [[nodiscard]] virtual bool slides() const { return false; }
  /// The increment (6 per node) that was followed from where the last tangent was made.
  virtual void predict(const VectorX& /*increment*/) {}
};

}  // namespace tunica
