#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/labels/border_lids.hpp"
#include "tunica/volume/labels/mask.hpp"
#include "tunica/volume/labels/volume.hpp"

#include <memory>
#include <optional>

namespace tunica {

/// Rows j and slices k, [first, one past the last), outside of which a mask holds nothing.
struct MaskBounds {
  std::array<std::size_t, 2> rows;
  std::array<std::size_t, 2> slices;
};

struct MarchingCubesOptions {
  /// false: beyond the image everything is outside, and the surface closes half a voxel beyond the last centres, on the
  /// image's border. true: beyond the image everything continues as it was, and the surface ends, open and flat, on
  /// the image's border (the outer faces of the outermost voxels).
  bool open_border = false;
  /// With open_border: where the border closes the surface all the same. Lives until the mesh is there.
  const BorderLids* lids = nullptr;
  /// The rest of the mask is not looked at; the mesh is the same.
  std::optional<MaskBounds> bounds;
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
/// Errors: InputError: require_volume(); dimensions of volume, mask, bounds or lids that do not suit each other; an
/// isovalue that is not-a-number; when the mesh would exceed 2^31 - 1 vertices or triangles.
/// Source: Lorensen and Cline 1987; rows and partitioned output as in flying edges (Schroeder, Maynard, Geveci 2015),
/// on bits.
/// Cost: two passes over one bit per voxel; memory: the mask, the mesh, a few slices of bits per thread, and for above
/// and below what join_pinched_vertices() takes where samples equal the value.
/// Limits: no choice of the face's diagonal by the values (asymptotic decider); triangles may be slivers.
TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const Mask& mask,
                            const MarchingCubesOptions& options = {});
TriangleMesh marching_cubes(const Volume& volume, const Inside& rule, const MarchingCubesOptions& options = {});
TriangleMesh marching_cubes(const Mask& mask, const MarchingCubesOptions& options = {});

/// The same mesh, to the bit, from values that come slab by slab, for a volume larger than memory: the mask, one bit
/// per voxel, is at hand, the values are not. For a rule by label marching_cubes(mask) needs no values at all.
///
///   Mask mask(dims, affine);                            // first reading of the volume
///   for each slab: select(slab, first_slice, rule, mask);
///   SlabMarchingCubes cubes(mask, rule);                // second reading
///   for each slab: cubes.add(slab, first_slice);
///   TriangleMesh mesh = cubes.finish();
///
/// Cost: memory: the mesh, two copies of a slice, one of the slab.
class SlabMarchingCubes {
public:
  /// Counts and lays out the mesh. Errors: as marching_cubes().
  /// @param mask  lives as long as this
  SlabMarchingCubes(const Mask& mask, const Inside& rule, const MarchingCubesOptions& options = {});
  ~SlabMarchingCubes();
  SlabMarchingCubes(const SlabMarchingCubes&) = delete;
  SlabMarchingCubes& operator=(const SlabMarchingCubes&) = delete;

  /// Takes the next slices of the volume, [first_slice, first_slice + slab.dims[2]), in order.
  void add(const Volume& slab, std::size_t first_slice);
  /// After the last slab.
  TriangleMesh finish();

private:
  class Writer;
  friend TriangleMesh marching_cubes(const Mask& mask, const MarchingCubesOptions& options);

  std::unique_ptr<Writer> writer_;
  const Mask& mask_;
  double value_;
  std::size_t next_slice_ = 0;
  Volume::Data carry_;  ///< the last slice that came
};

}  // namespace tunica
