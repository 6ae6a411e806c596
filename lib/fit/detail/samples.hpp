#pragma once

#include "tunica/fit/detail/fit_mesh.hpp"
#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/patch_lanes.hpp"
#include "tunica/surface/distance/surface_walk.hpp"

namespace tunica {

/// Of threads.
inline constexpr std::size_t patches_per_block = 16;

/// A point of the target that shells must be close to; one of its boundary, their boundary edges.
struct SamplePoint {
  Vec3 point;
  bool of_boundary = false;
};

/// Measures patches against the target, both ways: from a grid of points of each patch to the closest point of the
/// target on the side that the patch faces, and from points of the target to the patch that they are attached to.
/// Boundaries are measured as curves besides, both ways too. Sampled: certificates see what is missed.
class FitSamples {
public:
  /// @param shells      roughly how many there will be: it sets how many points of the target are used
  /// @param boundaries  whether the shells' boundary is to be the target's; else it is only where they end
  FitSamples(const Target& target, std::size_t shells, bool boundaries);

  [[nodiscard]] const Target& target() const { return target_; }
  [[nodiscard]] const std::vector<SamplePoint>& points() const { return points_; }

  /// A further point of the target that must be met, such as one that a certificate found.
  void add(const SamplePoint& point) { points_.push_back(point); }

  /// Attaches every point to the patch it is closest to. Parallel.
  void attach(FitMesh& mesh) const;
  /// The piece's points to its patch whose facet, or boundary edge, is closest.
  void attach(FitPiece& piece) const;

  /// Finds a patch's residuals and error.
  /// @param search_beyond  mm: what seems farther off is looked for again among all of the target
  void measure(const FitPiece& piece, FitPatch& patch, double search_beyond) const;
  /// Of all patches. Parallel. @return mm, the largest error
  double measure(FitPiece& piece) const;

  /// The target's point and normal closest to p on the side of `facing`.
  [[nodiscard]] Target::Foot foot(const Vec3& p, const Vec3& facing) const;

private:
  void from_patch(const PatchPowers& powers, const Vec3& facing, double search_beyond, FitPatch& patch) const;
  void from_target(const CubicPatch& surface, const PatchPowers& powers, const Vec3& facing, FitPatch& patch) const;
  void from_boundary(const CubicPatch& surface, const Vec3& facing, FitPatch& patch) const;
  [[nodiscard]] Residual residual_of(const Vec2& at, const Vec3& p, const ClosestPoint::Hit& hit,
                                     const Vec3& facing) const;

  const Target& target_;
  SurfaceWalk walk_;
  bool boundaries_;
  std::vector<SamplePoint> points_;
  std::vector<Vec2> grid_;  // of a patch's points
};

}  // namespace tunica
