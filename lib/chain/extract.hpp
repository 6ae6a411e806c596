#pragma once

#include "tunica/chain/context.hpp"
#include "tunica/io/scene/scene.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/cubes/marching_cubes.hpp"
#include "tunica/volume/labels/mask.hpp"
#include "tunica/volume/smoothing/smoothing.hpp"
#include "tunica/wall/face_distance.hpp"
#include "tunica/wall/mid_surface.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace tunica::chain {

struct ExtractSettings {
  bool largest = false;                      ///< keep the largest component alone
  bool fill_cavities = false;                ///< drop their surfaces
  bool open_border = false;                  ///< leave open what the image's border cuts
  std::vector<HalfSpaceNodes> cuts;          ///< planes beyond which nothing stays, in the axes of the output
  std::vector<std::string> cuts_as_written;  ///< in messages, as many
  std::optional<WallFace> face;              ///< of a wall: this one alone
  bool staircase = false;                    ///< smooth the steps of the voxels
  std::optional<double> sigma;               ///< mm: of a Gaussian that smooths instead
  bool ras = false;                          ///< axes of the output: RAS in place of LPS
};

/// Voxels that were selected, and how their surface is made of them.
struct SelectedVoxels {
  Inside inside;             ///< of several labels the first
  std::string name;          ///< "label 3 (aorta)", "above 200"
  std::string in_file_name;  ///< for {label}
  Mask mask;
  std::optional<MaskBounds> bounds{};  ///< where the mask holds anything, if known
  const Volume* volume = nullptr;      ///< the values of a grey volume that are at hand
  /// Shows them slab by slab where they are not.
  std::function<void(const std::function<void(const Volume& slab, std::size_t first_slice)>&)> show_values{};
  std::string file = "VOLUME";     ///< in messages
  std::optional<WallFace> face{};  ///< of the wall that was selected: the mask is what it bounds
};

/// What is known of an extracted surface. A sum of several has no diagonal.
struct SurfaceNumbers {
  std::size_t vertices = 0, triangles = 0, components = 0, openings = 0;
  long euler = 0;
  bool closed = true, manifold = true;
  bool oriented_outward = true;    ///< normals point from inside to outside
  std::optional<double> volume;    ///< mm^3, signed; none where it is open
  double voxel_volume = 0;         ///< mm^3, of all that was selected, or of what cuts leave of it
  double area = 0;                 ///< mm^2
  std::optional<double> diagonal;  ///< mm
  std::optional<StaircaseResult> staircase;
  std::optional<WallFace> face;           ///< of a wall
  std::optional<FaceDistance> thickness;  ///< mm, of that wall
};

struct Extraction {
  TriangleMesh mesh;                  ///< mm, LPS, whatever the output's axes
  std::optional<TriangleMesh> other;  ///< the wall's other face
  std::string name;                   ///< what it is of
  SurfaceNumbers numbers;
};

/// The surface of selected voxels. Warns of what smoothing, the border and the choice of pieces did to it.
/// Errors: InputError: it is empty; no wall around a hollow, of which a face is asked for; a plane misses it.
/// Cost: as marching_cubes() and smooth_staircase().
Extraction extract(SelectedVoxels selected, const ExtractSettings& settings, const Context& context = {});

/// Sums of what can be summed, over the surfaces of several labels.
SurfaceNumbers sum_of(const std::vector<SurfaceNumbers>& surfaces);

}  // namespace tunica::chain
