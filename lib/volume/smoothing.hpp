#pragma once

#include "core/progress.hpp"
#include "surface/triangle_mesh.hpp"
#include "volume/mask.hpp"
#include "volume/volume.hpp"

namespace tunica {

/// A smoothed field and the rule by which its samples are inside.
struct SmoothedField {
  Volume field;
  Inside rule;
};

/// Gaussian smoothing of a selection: 1 inside, 0 outside, convolved with a Gaussian of `sigma` mm along each axis of
/// the image (cut at four sigma, weights normalised over what lies in the image, so that the border does not draw the
/// surface in). The level is the one whose marching-cubes surface, closed at the image's border, encloses the volume of
/// the selected voxels to 0.01 % where the field allows it.
/// Errors: UsageError unless sigma is positive and finite.
/// Cost: two float volumes; time proportional to voxels times sigma over voxel size, and some four extractions.
/// Limits: the volume is kept as a whole, not per piece; parts thinner than about 2 sigma break. With a sheared affine
/// the Gaussian is sheared as well.
SmoothedField smooth_mask(const Mask& mask, double sigma, const Progress& progress = {});

/// The same Gaussian on the values (slope * v + intercept) of a grey volume; the value of the surface stays as it is.
/// Limits: a sample that is not finite spoils all within four sigma of it.
Volume smooth_values(const Volume& volume, double sigma, const Progress& progress = {});

}  // namespace tunica
