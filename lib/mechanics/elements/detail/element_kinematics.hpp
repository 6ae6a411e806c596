#pragma once

#include "tunica/mechanics/elements/element_lanes.hpp"

/// From the motion of the corners to the state of an element, for element_lanes.cpp and make_shell_element() alone: the
/// reference is made by the same operations as the states, so that it is at rest to the last bit.
namespace tunica {

/// The current frame: rows f1, f2, n.
struct Frame {
  LaneMat3 axes;
  LaneMat23 plane;  ///< columns: corners minus centroid, in the frame
  Lanes trace = 0;  ///< of the in-plane stretch
  Lanes twice_area = 0;
};

/// @return where there is one: the triangle has not collapsed or turned inside out.
LaneMask find_frame(const LaneMat3& from_centroid, const LaneMat23& gradients, Frame& frame);

/// An edge in the frame, and what its ends carry.
struct EdgeNow {
  Lanes length = 0;
  LaneVec3 direction;
  std::array<LaneVec3, 2> normal;  ///< R m
  std::array<LaneVec3, 2> side;    ///< R c
};

/// Everything that follows from the motion, in the frame's axes.
struct Kinematics {
  Frame frame;
  std::array<EdgeNow, 3> edges;
  LaneVector6 slopes;
  LaneVec3 bulges;  ///< of the edges: slope at the start less that at the end
  LaneVec3 tilts;
  LaneState state;

  [[nodiscard]] LaneVec3 rotation(int corner) const { return state.segment<3>(3 + 3 * corner); }
};

/// @return as find_frame().
LaneMask find_kinematics(const ElementLanes& element, const MotionLanes& motion, Kinematics& now);

/// No displacement, no rotation.
MotionLanes no_motion();

}  // namespace tunica
