// volume/phantom: segmented volumes whose true surface is known.
#pragma once

#include "tunica/core/progress.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/labels/volume.hpp"

#include <cstdint>
#include <optional>
#include <string_view>

namespace tunica {

enum class PhantomShape {
  sphere,
  tube,      ///< a bent vessel that runs through the image along z: its ends are cut by the image's border
  aneurysm,  ///< such a vessel with a sac
  capsule,   ///< a cylinder with spherical ends, in a direction off the axes
  bladder,   ///< two lobes, a neck and a dent
  colon,     ///< a frame of pouches
};

/// The shape with this name ("sphere", …), or none.
std::optional<PhantomShape> phantom_shape(std::string_view name);

struct PhantomOptions {
  PhantomShape shape = PhantomShape::sphere;
  std::size_t size = 128;  ///< voxels on the longest side, 16 to 4096
  Vec3 spacing{1, 1, 1};   ///< mm
  double noise = 0;        ///< probability with which a voxel at the border of the shape is flipped, 0 to 1
  std::uint64_t seed = 1;  ///< of the noise; the same voxels are flipped on every machine
  Progress progress;
};

struct Phantom {
  Volume volume;            ///< 1 inside, 0 outside, centred at the world's origin
  std::size_t inside = 0;   ///< voxels
  std::size_t flipped = 0;  ///< voxels changed by noise
};

/// A segmented volume whose true surface is known: a voxel is inside when its centre is. The shape fills the image up
/// to two voxels at each side (the ends of tube and aneurysm: none).
/// Errors: UsageError for options out of range, and for more voxels than the machine's memory holds.
/// Cost: one byte per voxel; the time grows with the surface, not with the volume.
Phantom make_phantom(const PhantomOptions& options);

/// The true surface of make_phantom(options), noise or not, as a dense mesh in world mm: vertices on the surface to
/// 1e-9 of the image's size, edges about 1/256 of its longest side. Closed; of tube and aneurysm open, ending flat on
/// the image's border (the outer faces of the outermost voxels), as marching_cubes() with open_border does.
TriangleMesh phantom_surface(const PhantomOptions& options);

/// Volume inside phantom_surface(), mm^3; open ends count as closed by flat lids.
double phantom_volume(const TriangleMesh& surface);

}  // namespace tunica
