#pragma once

#include "tunica/core/types.hpp"

#include <limits>

namespace tunica {

/// What a contact does in one state.
struct ContactState {
  Vec3 force = Vec3::Zero();   ///< N, on the first body; of a body with itself none
  Vec3 moment = Vec3::Zero();  ///< N mm, on the first body, about the origin
  double area = 0;             ///< mm^2 where more than a tenth of the mean pressure acts
  /// mm, between which the smallest gap certainly lies; below zero: the bodies overlap. NaN: not known.
  double gap_lower = std::numeric_limits<double>::quiet_NaN();
  double gap_upper = std::numeric_limits<double>::quiet_NaN();
  std::size_t points = 0;  ///< samples that press
  double slip = 0;         ///< mm, the largest of them
};

/// Where a rigid body is in one state, and what the others do to it.
struct RigidState {
  Vec3 force = Vec3::Zero();     ///< N, on it
  Vec3 moment = Vec3::Zero();    ///< N mm, on it, about the origin
  Vec3 position = Vec3::Zero();  ///< mm: its centre, or the midpoint of its axis
};

}  // namespace tunica
