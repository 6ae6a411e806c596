#pragma once

#include "tunica/core/types.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <cstddef>
#include <optional>
#include <vector>

namespace tunica {

/// What a selection encloses, as a wall encloses its lumen: 6-connected components of what is outside that the
/// selection parts from the rest. Also where the selection is one voxel thick, so that an 18-connected cavity
/// (fill_cavities()) leaks through it across edges; and also where the image's border cuts the wall, so that the lumen
/// ends there within the wall's rim.
///
/// At the border a component is a hollow when it touches no edge of the image (its sections lie within a rim on one
/// face), or when the selection bounds more of its area than the border does. What has most of the border, of those
/// that touch an edge of the image, is the outside whatever its area. Axes of one voxel have no border.
struct Hollows {
  Mask voxels;                     ///< of the hollows that count: from a hundredth of the largest on
  Mask all;                        ///< and of the smaller ones too
  std::vector<std::size_t> sizes;  ///< voxels of those that count, largest first
  double share = 0;                ///< theirs, of what they and the selection fill together
  Vec3 middle = Vec3::Zero();      ///< centroid of the largest, mm
  bool closed = true;              ///< none that counts is at the image's border
};

/// Cost: a pass over the bits, some 100 bytes per run of outside voxels. Errors: Interrupted.
Hollows find_hollows(const Mask& mask);

/// The solid whose surface is the inner face of a wall: its hollows, with whatever lies within them.
Mask inner_solid(const Hollows& hollows);

/// The solid whose surface is the outer face of a wall: the selection and all that it encloses. Errors: InputError:
/// different dimensions.
Mask outer_solid(const Mask& wall, const Hollows& hollows);

/// Two large parts of a selection that few voxels join.
struct Bridge {
  Vec3 place = Vec3::Zero();  ///< where they are nearest to each other, mm
  std::size_t section = 0;    ///< faces of voxels by which they are joined
  double share = 0;           ///< of the selection's voxels, of the smaller part
};

/// The narrowest bridge, if there is one: the selection without its outermost voxels falls apart, two of its parts have
/// a twentieth of its voxels or more each, and no more than nine faces of voxels (three by three) join them. Two
/// vessels that lie side by side and touch are so; the ends of a branch or a narrow colon are smaller, or wider.
/// Errors: Interrupted. Cost: two passes over the bits; where parts are found, 100 bytes per voxel of the surface.
std::optional<Bridge> find_bridge(const Mask& mask);

}  // namespace tunica
