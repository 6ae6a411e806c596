#pragma once

#include "core/progress.hpp"
#include "surface/triangle_mesh.hpp"
#include "volume/mask.hpp"
#include "volume/volume.hpp"

namespace tunica {

struct MarchingCubesOptions {
  /// false: beyond the image everything is outside, and the surface closes half a voxel beyond the last centres, on the
  /// image's border. true: beyond the image everything continues as it was, and the surface ends, open and flat, on
  /// the image's border (the outer faces of the outermost voxels).
  bool open_border = false;
  Progress progress;
};

/// The surface between inside and outside, in world mm, by marching cubes.
///
/// Whatever the volume, the result is an oriented 2-manifold without degenerate triangles, normals from inside to
/// outside (also where the affine mirrors); closed, or with `open_border` bounded by curves on the image's border.
/// Where only two diagonal corners of a face are inside they are cut apart: the surface has as many components as the
/// selection has 6-connected pieces and 18-connected cavities (see components.hpp). Elsewhere vertices and triangle
/// counts are those of Lorensen and Cline.
/// Vertices: for labels and masks half-way between two voxel centres; for above and below where the linear
/// interpolation of the two samples equals the value, and half-way next to a sample that is not finite. Where samples
/// equal the value, the triangles that would have no area are collapsed.
/// The mesh is the same to the bit whatever the number of threads.
/// @param mask  the selection by `rule`, of which whole pieces and cavities may have been edited out
/// @return no triangles when nothing is inside
/// Errors: InputError when the mesh would exceed 2^31 - 1 vertices or triangles.
/// Source: Lorensen and Cline 1987; rows and partitioned output as in flying edges (Schroeder, Maynard, Geveci 2015),
/// on bits.
/// Cost: two passes over one bit per voxel; memory: the mask, the mesh, a few rows per thread.
/// Limits: no choice of the face's diagonal by the values (asymptotic decider); triangles may be slivers.
TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const Mask& mask,
                            const MarchingCubesOptions& options = {});
TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const MarchingCubesOptions& options = {});
TriangleMesh marching_cubes(const Mask& mask, const MarchingCubesOptions& options = {});

}  // namespace tunica
