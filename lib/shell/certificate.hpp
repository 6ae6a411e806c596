#pragma once

#include "core/types.hpp"
#include "shell/curved_surface.hpp"
#include "shell/target.hpp"

#include <algorithm>
#include <optional>
#include <vector>

/// The two directions of curved_hausdorff().
namespace tunica {

/// When a piece of a surface is settled.
struct Aim {
  double width;                 ///< mm: upper - lower wanted
  std::optional<double> limit;  ///< mm: whether the distance is at most this is all that matters
  double uncertainty;           ///< mm: rounding, one-sided

  /// mm: an upper bound that does, when the distance is certainly at least `lower`
  [[nodiscard]] double enough(double lower) const {
    return limit ? std::max(lower + width, *limit - uncertainty) : lower + width;
  }
  [[nodiscard]] bool decided_above(double lower) const { return limit && lower - uncertainty > *limit; }
};

/// Largest distance from one surface to another, mm.
struct OneSided {
  Interval distance;
  Vec3 farthest = Vec3::Zero();  ///< a point whose distance is at least distance.lower
  Vec3 closest = Vec3::Zero();   ///< the point of the other surface closest to it
};

/// Gathers what blocks of pieces found, in their order: raises the bounds, and keeps the pieces that are not settled.
/// @param lower  mm: certain distance so far, of the place `farthest`; settled  mm: largest bound of a settled piece
template <typename Block, typename Place>
auto collected(const std::vector<Block>& blocks, const Aim& aim, double& lower, double& settled, Place& farthest) {
  for (const Block& block : blocks) {
    if (block.lower > lower) {
      lower = block.lower;
      farthest = block.farthest;
    }
    settled = std::max(settled, block.settled);
  }
  const double enough = aim.enough(lower);
  decltype(Block::live) live;
  for (const Block& block : blocks) {
    for (const auto& piece : block.live) {
      if (piece.upper <= enough) {
        settled = std::max(settled, piece.upper);
      } else {
        live.push_back(piece);
      }
    }
  }
  return live;
}

/// How many pieces one direction cuts before it gives up and its interval comes out wider.
inline constexpr std::size_t most_certified_pieces = 2'000'000;

/// From the curved surface to the target: parts of patches are bounded by the distance of their chord triangle and how
/// far they bulge from it, and cut where that does not do.
OneSided shell_to_target(const std::vector<CubicPatch>& patches, const Target& target, const Aim& aim);

/// Triangles, neighbours in space mostly one after the other.
struct SurfaceInOrder {
  const std::vector<Vec3>& vertices;                   ///< #V
  const std::vector<std::array<Index, 3>>& triangles;  ///< #F
  const std::vector<Index>& order;                     ///< #F, all of them

  static SurfaceInOrder of(const Target& target) {
    return {target.tree().vertices(), target.tree().triangles(), target.tree().spatial_order()};
  }
};

/// From the target to the curved surface: a piece of a triangle of the target is bounded by the part of one patch
/// between the feet of its corners, point by point at equal parameters, and cut where that does not do, at first along
/// the edge between the patches of its corners.
/// @param expected  mm: roughly what the distance is; how well it is known decides about the time only
OneSided target_to_shell(const ShellMesh& shell, const std::vector<CubicPatch>& patches, const SurfaceInOrder& target,
                         const Aim& aim, double expected);

}  // namespace tunica
