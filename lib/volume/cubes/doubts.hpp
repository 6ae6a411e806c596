#pragma once

#include "tunica/core/warning.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"
#include "tunica/volume/cubes/openings.hpp"
#include "tunica/volume/labels/hollows.hpp"
#include "tunica/volume/labels/mask.hpp"

#include <optional>
#include <string>
#include <vector>

namespace tunica {

/// What warnings of an extraction are about, and in which axes its places are given.
struct Subject {
  std::string name;  ///< "label 3 (aorta)"
  bool ras = false;  ///< places are in RAS, not in LPS

  /// "(1.5, -2.0, 30.0) mm".
  [[nodiscard]] std::string at(const Vec3& place) const;
};

/// What was done with the cavities of a selection, 18-connected ones (components.hpp).
struct CavityFacts {
  std::size_t count = 0;
  std::size_t voxels = 0;
  bool filled = false;
};

/// A selection that is a wall: both of its faces become surfaces. And cavities, which are surfaces within surfaces, or
/// are filled. `hollows` and `cavities` are of the selection before anything was filled.
std::vector<Warning> doubt_hollows(const Subject& subject, const Mask& mask, const Hollows& hollows,
                                   const CavityFacts& cavities);

/// A face of a wall was asked for: of a selection that hardly encloses anything, or that encloses several hollows.
std::vector<Warning> doubt_wall(const Subject& subject, const Hollows& hollows);

/// Two organs that touch, such as two vessels, in one selection.
std::vector<Warning> doubt_bridge(const Subject& subject, const std::optional<Bridge>& bridge);

/// Cuts through a side, on which lids were put. @param area  of the surface with the lids, mm^2
std::vector<Warning> doubt_openings(const Subject& subject, const Openings& openings, double area);

/// Rims that are a few voxels wide, and those that run over several faces of the image.
/// @param surface  with an open border, not smoothed; rims  its boundary_loops()
std::vector<Warning> doubt_rims(const Subject& subject, const Mask& mask, const TriangleMesh& surface,
                                const std::vector<std::vector<Index>>& rims);

/// The border cuts the selection, and lids close it. @param inside  the rule; other_side  what the other one is called
std::vector<Warning> doubt_closed_border(const Subject& subject, const Mask& mask, const Inside& inside);

/// Pieces were left out. @param share  theirs, of the voxels
std::vector<Warning> doubt_pieces(const Subject& subject, double share);

/// Smoothing moved voxels. @param share  of the selection's, that went in or out
std::vector<Warning> doubt_smoothing(const Subject& subject, double share);

/// A surface runs halfway between the middles of voxels and is rounded off there: what is a few voxels thick loses
/// volume. @param volume  of the closed surface, mm^3
std::vector<Warning> doubt_volume(const Subject& subject, const Mask& mask, double volume);

}  // namespace tunica
