#pragma once

#include "tunica/core/types.hpp"
#include "tunica/shell/distance/shell_distance.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

/// The two directions of curved_hausdorff().
namespace tunica {

/// Of threads: patches, pieces of them, triangles, pairs. Results are summed block by block, so they do not depend on
/// the number of threads.
inline constexpr std::size_t items_per_block = 256;

/// When a piece of a surface is settled.
struct Aim {
  double width;                 ///< mm: upper - lower wanted
  std::optional<double> limit;  ///< mm: whether the distance is at most this is all that matters
  double uncertainty;           ///< mm: rounding, one-sided
  bool list_beyond = false;     ///< see ShellDistanceOptions; then there is a limit

  /// mm: an upper bound that does, when the distance is certainly at least `lower`
  [[nodiscard]] double stop_at(double lower) const {
    if (list_beyond) {
      return std::max(std::min(lower, *limit) + width, *limit - uncertainty);
    }
    return limit ? std::max(lower + width, *limit - uncertainty) : lower + width;
  }
  [[nodiscard]] bool decided_above(double lower) const { return limit && !list_beyond && lower - uncertainty > *limit; }
  /// Whether a place so far off is listed: those just below the limit too, which leave the answer open.
  [[nodiscard]] bool is_listed(double distance) const { return list_beyond && distance > listed_share * *limit; }
  /// Whether a piece with a point so far off need not be cut any more.
  [[nodiscard]] bool is_beyond(double distance) const { return list_beyond && distance - uncertainty > *limit; }

  static constexpr double listed_share = 0.985;
};

/// Largest distance from one surface to another, mm.
struct OneSided {
  Interval distance;
  Vec3 farthest = Vec3::Zero();  ///< a point whose distance is at least distance.lower
  Vec3 closest = Vec3::Zero();   ///< the point of the other surface closest to it
  std::vector<FarPlace> beyond;  ///< where asked for: places beyond the limit, the farthest found of each patch
};

/// The farthest place found of each patch.
class FarPlaces {
public:
  void add(const FarPlace& place) {
    const auto [found, is_first] = of_patch_.emplace(place.patch, place);
    if (!is_first && place.distance > found->second.distance) {
      found->second = place;
    }
  }
  [[nodiscard]] std::vector<FarPlace> all() const {
    std::vector<FarPlace> places;
    for (const auto& [patch, place] : of_patch_) {
      places.push_back(place);
    }
    return places;
  }

private:
  std::map<Index, FarPlace> of_patch_;
};

/// Gathers what blocks of pieces found, in their order: raises the bounds, and keeps the pieces that are not settled.
/// @param lower  mm: certain distance so far, of the place `farthest`; settled  mm: largest bound of a settled piece;
/// beyond  what blocks listed
template <typename Block, typename Place>
auto collected(const std::vector<Block>& blocks, const Aim& aim, double& lower, double& settled, Place& farthest,
               FarPlaces& beyond) {
  for (const Block& block : blocks) {
    for (const FarPlace& place : block.beyond) {
      beyond.add(place);
    }
    if (block.lower > lower) {
      lower = block.lower;
      farthest = block.farthest;
    }
    settled = std::max(settled, block.settled);
  }
  const double goal = aim.stop_at(lower);
  decltype(Block::live) live;
  for (const Block& block : blocks) {
    for (const auto& piece : block.live) {
      if (piece.upper <= goal) {
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
