#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/labels/border_lids.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <cstddef>
#include <vector>

namespace tunica {

/// Where the image's border cuts a selection: a connected part of one face of the image.
struct Opening {
  int axis = 0;                ///< of the image, that the face is across
  bool upper = false;          ///< its side
  std::size_t voxels = 0;      ///< of the selection on that face
  double area = 0;             ///< mm^2
  Vec3 middle = Vec3::Zero();  ///< mm, on the border
  bool is_end = true;          ///< of a vessel, and not a cut through its side
};

struct Openings {
  std::vector<Opening> openings;  ///< largest first
  BorderLids lids;                ///< on those that are no ends
};

/// Tells the ends of vessels from cuts through a side. Around an end the wall turns about the way out of the image: of
/// the squares of its unit normals, averaged over the surface within two voxels of the rim, the part along the normal
/// of the border's plane is small beside the parts along any direction in that plane. It counts as an end while that
/// part is no more than twice the smallest of these: a vessel that leaves at 55 degrees or less from the plane's
/// normal, or a ball whose wall meets the border's plane at 45 degrees or more. A vessel that runs along the border has
/// no part along its own axis, which lies in the plane; a dome that the border shaves off has hardly any in the plane.
/// Where no rim is, the border cuts no wall: no end. In an image of two slices all are ends, for nothing shows where
/// the wall goes.
/// @param surface  of the selection, by marching_cubes() with an open border and no lids, not smoothed
/// Cost: linear in the surface and in the image's border. Errors: InputError as require_valid() of it. Interrupted.
Openings find_openings(const Mask& mask, const TriangleMesh& surface);

/// Connected parts of the image's faces where its border cuts a selection, ends or not. Cost: linear in the border.
std::size_t count_border_cuts(const Mask& mask);

/// A surface without the lids on the image's border: triangles that lie within half a voxel of a face of the image, as
/// both faces of a wall do there. The whole surface where nothing else is left. Errors: InputError as
/// require_valid() of the surface.
TriangleMesh without_border(const TriangleMesh& surface, const Mask& mask);

}  // namespace tunica
