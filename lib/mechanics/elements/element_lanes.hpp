// mechanics/elements: shell elements, their co-rotation, the pressure on them.
#pragma once

#include "tunica/mechanics/elements/lanes.hpp"
#include "tunica/mechanics/elements/shell_element.hpp"

/// The shell elements' forces and tangents, several elements at once: what a run spends its time with outside the
/// linear solver. Theory and names: shell_element.hpp, whose functions on one element are these with equal lanes.
namespace tunica {

using LaneState = Eigen::Matrix<Lanes, 15, 1>;

/// The members of ShellElement of the same names.
struct ElementLanes {
  bool curved = false;  ///< of all
  bool skewed = false;  ///< some skewing is not zero
  LaneMat3 axes;
  LaneMat3 from_centroid;
  LaneMat23 plane;
  LaneMat23 gradients;
  LaneMat3 edge_normals;
  LaneMat3 edge_sides;
  LaneVector6 slopes;
  LaneVector6 rest_normals;
  LaneVector6 rest_sides;
  LaneMat3 bow;
  LaneVec3 bending_edges;
  LaneVector6 height_weights;
  std::array<LaneMatrix6, 3> bulging;
  LaneMat3 sideways;
  LaneVec3 tilts;
  LaneMat23 edge_directions;
  LaneMat3 membrane;
  LaneMatrix9 rotational;
  LaneVec3 skewing;
  LaneState prestrain;
};

/// All must be `curved`, or none; an element may stand in several lanes.
using ElementGroup = std::array<const ShellElement*, lane_count>;
void gather(const ElementGroup& elements, ElementLanes& lanes);

/// One element in all lanes.
ElementLanes same(const ShellElement& element);

/// CornerMotion of each.
struct MotionLanes {
  LaneMat3 displacement;
  std::array<LaneMat3, 3> rotation;
};

/// One motion in all lanes.
MotionLanes same(const CornerMotion& motion);

/// Viscous of each.
struct ViscousLanes {
  double factor = 0;
  LaneState previous;  ///< used where factor > 0
};

struct ResponseLanes {
  LaneState deformation;
  LaneVector18 force;
  Lanes energy = 0;
};

/// deformation() of each. @return where it would be true; the other lanes hold nothing of use.
LaneMask deformation(const ElementLanes& element, const MotionLanes& motion, LaneState& result);

/// The state after an increment of displacements and spins (world axes), to first order: what the tangent at `motion`
/// expects. Valid where deformation() is.
LaneState predicted_deformation(const ElementLanes& element, const MotionLanes& motion, const LaneVector18& increment);

/// corotational_response() of each. @return as above. No allocation.
/// @param predicted  where given, the geometric stiffness takes its stresses from this deformation instead of the
///                   current one (predicted_deformation() of the last increment). The forces do not.
LaneMask corotational_response(const ElementLanes& element, const MotionLanes& motion, const ViscousLanes& viscous,
                               ResponseLanes& response, LaneMatrix18* tangent, const LaneState* predicted = nullptr);

/// unit_pressure() on each (pressure.hpp).
void unit_pressure(const ElementLanes& element, const MotionLanes& motion, LaneVector18& force, LaneMatrix18* stiffness,
                   Lanes* volume = nullptr);

/// linear_deformation() of each.
LaneState linear_deformation(const ElementLanes& element, const LaneVector18& motion);

/// What linear_stiffness() times the motion (as above) stands for, by way of strains and stresses: those of bending are
/// right to round-off, where the entries of the stiffness are too coarse for them on very thin shells.
LaneVector18 linear_force(const ElementLanes& element, const LaneVector18& motion);

/// linear_stiffness() of each.
LaneMatrix18 linear_stiffness(const ElementLanes& element);

}  // namespace tunica
