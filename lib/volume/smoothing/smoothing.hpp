// volume/smoothing: Gaussian and staircase smoothing of what is extracted.
#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/labels/mask.hpp"
#include "tunica/volume/labels/volume.hpp"

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

struct StaircaseOptions {
  /// The surface was extracted with an open border: what lies on the image's border stays in its plane.
  bool open_border = false;
  Progress progress;
};

struct StaircaseResult {
  double largest_move = 0;    ///< in voxels, along any axis of the image; below 0.5
  double volume_change = 0;   ///< largest of any component of 100 voxels or more, as a fraction of its volume
  std::size_t held_back = 0;  ///< vertices that stayed nearer to where they were: no triangle turned over or crossed
};

/// Smooths away the staircase of a marching-cubes surface: a surface with the same triangles, whose vertices stay
/// within half a voxel of where they were, along each axis of the image. At each of them it is the quadric that fits
/// best the voxels' edges around, which the true surface crosses somewhere, over the largest surroundings that are as
/// smooth as that (local_quadrics.hpp); a surface that bends little, found first, says where the edges lie on it.
///
/// Every point of the result lies within half a voxel, per axis, of the corresponding point of the input, and the other
/// way round: corners move by less than half a voxel, and points within a triangle move by means of the corners'
/// moves. Each component of 100 voxels or more keeps its volume to 0.1 %, by an offset along the normals that respects
/// the same limits; where that does not reach, its moves are taken back. Triangles stay as they are, and none is turned
/// over or flattened; nor do any two touch or cross that did not before. All of this is asserted on the result.
/// The result is the same to the bit whatever the number of threads.
/// @param mesh  the marching-cubes surface of a selection, in world mm; changed in place
/// @param grid  the selection (its dims and affine are used)
/// Errors: InputError as require_valid() of the mesh.
/// Source: Gibson, Constrained elastic surface nets, MICCAI 1998, with a thin plate's energy in place of springs;
/// Nesterov's accelerated projected gradient with restarts (O'Donoghue and Candes 2015); moving least squares.
/// Cost: up to 500 passes over the mesh and 10 microseconds per vertex.
/// Limits: the mean error to the true surface falls to a seventh where the organ's features are ten voxels across or
/// more, to 0.3 to 0.6 of the staircase's below, and hardly where they are thinner than a slice: there marching cubes
/// itself lies some 0.05 voxels too far inside, which keeping its volume keeps.
StaircaseResult smooth_staircase(TriangleMesh& mesh, const Mask& grid, const StaircaseOptions& options = {});

}  // namespace tunica
