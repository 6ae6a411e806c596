#pragma once

#include "tunica/shell/patch/curved_surface.hpp"
#include "tunica/shell/patch/patch_lanes.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/incidence.hpp"
#include "tunica/surface/mesh/measure.hpp"

namespace tunica {

/// Where a point has a point of a curved surface near it. The distance is never below the true one.
struct SurfaceFoot {
  Index patch = 0;
  Vec2 at = Vec2::Zero();
  Vec3 point = Vec3::Zero();
  double distance = 0;  ///< mm
};

/// Closest points of a curved surface. Queries are thread-safe.
/// Cost: build linear, 16 small triangles per patch; near() a microsecond or two, nearest() some ten.
class PatchSearch {
public:
  /// Keeps a reference to the patches, which are those of `shell`.
  PatchSearch(const ShellMesh& shell, const std::vector<CubicPatch>& patches);

  /// Nearly always the closest point.
  /// @param guess  what the last call answered with for a point nearby, kept up to date
  [[nodiscard]] SurfaceFoot near(const Vec3& p, std::optional<Index>& guess) const;

  /// The foot on one patch, from a start; where it comes to lie on an edge, on the neighbour's side of it when that is
  /// closer.
  [[nodiscard]] SurfaceFoot near(const Vec3& p, Index patch, const Vec2& start) const;

  /// The foot on one patch alone, from the foot on its facet or another start. Cost: under a microsecond.
  [[nodiscard]] SurfaceFoot on_patch(const Vec3& p, Index patch) const;
  [[nodiscard]] SurfaceFoot on_patch(const Vec3& p, Index patch, const Vec2& start) const;

  /// @param foot  in: any; out: a closer one where there is one by more than `tolerance` (mm)
  /// @return mm: certainly no more than the true distance, and no less than foot.distance - 2 tolerance, but for
  ///         rounding and for patches so wild that they bulge by this from a part in a million of them
  [[nodiscard]] double nearest(const Vec3& p, double tolerance, SurfaceFoot& foot) const;

  /// mm: at equal parameters a flat triangle with its corners on a patch is no farther from it.
  [[nodiscard]] double bulge(Index patch, const Vec2& a, const Vec2& b, const Vec2& c) const;

  /// The edge (corner k to k + 1) of `patch` across which `other` lies; 3: none.
  [[nodiscard]] std::size_t edge_towards(Index patch, Index other) const;

private:
  struct Part {
    std::array<Vec2, 3> at;
    std::array<Vec3, 3> point;
    double bulge;
  };
  void search_box(std::size_t level, std::size_t box, const Vec3& p, double tolerance, SurfaceFoot& foot,
                  double& lower) const;
  void search_patch(Index patch, const Vec3& p, double tolerance, SurfaceFoot& foot, double& lower) const;
  void search_part(Index patch, const Part& part, int depth, const Vec3& p, double tolerance, SurfaceFoot& foot,
                   double& lower) const;

  const std::vector<CubicPatch>& patches_;
  std::vector<std::array<Index, 3>> across_;
  std::vector<PatchAxes> axes_;
  std::vector<double> flatness_;
  Tessellation coarse_;
  ClosestPoint tree_;
  std::vector<Index> order_;              // patches, neighbours in space side by side
  std::vector<std::vector<Box>> levels_;  // of patches in this order, then of 16 boxes each
};

}  // namespace tunica
