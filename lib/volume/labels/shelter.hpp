#pragma once

#include "tunica/core/types.hpp"
#include "tunica/volume/labels/mask.hpp"

namespace tunica {

/// What a selection stands around on most sides, though it need not enclose it: the lumen of a wall that is open along
/// a slit, at an end or by a hole. A voxel outside is sheltered when the straight lines from it in at least 18 of the
/// 26 directions to its neighbours, edges and corners too, meet the selection: in the middle of a tube 24 do, of one
/// with a slit over a third of its circumference 18, between the legs of a bent vessel or in the hilum of a kidney
/// fewer.
struct Shelter {
  double share = 0;            ///< of the largest 6-connected part of the sheltered voxels and the selection: that part
  Vec3 middle = Vec3::Zero();  ///< its centroid, mm
};

/// Beyond the image everything is as it is at the border: a line that leaves the image runs on along the border, so
/// that a vessel may end there. Lines step from face to face of voxels, so that none slips between two of the selection
/// that share an edge. Errors: Interrupted. Cost: 26 passes over the bits of the selection's box, six bits per voxel of
/// it, and 16 bytes per run sheltered.
Shelter find_shelter(const Mask& mask);

}  // namespace tunica
