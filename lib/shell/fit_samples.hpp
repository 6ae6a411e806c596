#pragma once

#include "core/lanes.hpp"
#include "shell/boundary_distance.hpp"
#include "shell/curved_surface.hpp"
#include "shell/patch_lanes.hpp"
#include "shell/start_grid.hpp"
#include "shell/target.hpp"
#include "surface/incidence.hpp"

#include <memory>
#include <optional>
#include <span>

namespace tunica {

/// A place of a patch and how far it is from where it should be: the point of the patch at `at` ought to move by
/// -distance along `direction`.
struct Residual {
  Vec2 at;
  Vec3 direction;   ///< unit
  double distance;  ///< mm, signed
};

/// What a patch is made of.
struct PatchShape {
  std::array<Vec3, 3> corners;
  std::array<Vec3, 3> normals;
  Patch kind = Patch::comas;
  std::optional<NormalsAcross> across = {};  ///< of a watertight patch with a crease along an edge

  [[nodiscard]] CubicPatch patch() const {
    return across ? watertight_patch(corners, normals, *across) : smooth_patch(kind, corners, normals);
  }
};

/// A point of a patch near a given one.
struct PatchFoot {
  Vec2 at;
  Vec3 point;
  double squared_distance;
};

/// The point of a patch closest to q, nearly: the foot on the facet, then two Gauss-Newton steps.
PatchFoot foot_on_patch(const CubicPatch& patch, const Vec3& q);

/// The same from another start, by at most so many steps, Newton's from the third on.
PatchFoot foot_on_patch(const CubicPatch& patch, const Vec3& q, Vec2 start, int steps);
PatchFoot foot_on_patch(const PatchAxes& patch, const Vec3& q, Vec2 start, int steps);

/// The points at 1/4, 1/2, 3/4 of a patch's edge between two corners.
std::array<Vec3, 3> edge_points(const CubicPatch& patch, std::size_t from, std::size_t to);

/// A point of the target that shells must be close to; one of its boundary, their boundary edges.
struct SamplePoint {
  Vec3 point;
  bool of_boundary = false;
};

/// Measures patches against the target, both ways: from a grid of points of each patch to the closest point of the
/// target on the side that the patch faces, and from points of the target to the patch that they are attached to.
/// Boundaries are measured as curves besides, both ways too.
class FitSamples {
public:
  /// @param shells      roughly how many there will be: it sets how many points of the target are used
  /// @param boundaries  whether the shells' boundary is to be the target's; else it is only where they end
  FitSamples(const Target& target, std::size_t shells, bool boundaries = true);

  /// The same measures by other points, such as those that a piece of the shells has to heed, and by a grid that is
  /// not too coarse for pieces.
  [[nodiscard]] FitSamples of_piece(std::vector<SamplePoint> points, std::vector<Vec3> further,
                                    std::vector<Vec3> further_boundary) const;

  [[nodiscard]] const std::vector<SamplePoint>& points() const { return points_; }
  [[nodiscard]] const Target& target() const { return target_; }
  [[nodiscard]] bool has_boundaries() const { return boundaries_; }

  /// Many more points of the target, neighbours in space one after the other, in which to look for what is missed: its
  /// vertices, at most 200,000, and of few triangles their centroids and the middles of their edges.
  [[nodiscard]] const std::vector<Vec3>& further_points() const { return further_; }

  /// The same of its boundary: vertices and the middles between them. Empty where that is only where shells end.
  [[nodiscard]] const std::vector<Vec3>& further_boundary_points() const { return further_boundary_; }

  /// Further points of the target that must be met, such as where the distance was found largest.
  void add(const SamplePoint& point) { points_.push_back(point); }

  /// Forgets the points added since there were so many.
  void keep(std::size_t count) { points_.resize(count); }

  /// Other points instead, such as those that there were before some were added: to be attached anew.
  void take_points(std::vector<SamplePoint> points) { points_ = std::move(points); }

  /// Appends the residuals of the grid of a patch's points. The target's closest points are looked for downhill from
  /// the last ones, ten times as fast as among all.
  /// @param facing  the facet's normal; doubted  mm: points that seem to be farther off are looked for among all;
  /// guesses  triangles of the target that were closest the last time, kept up to date
  void from_patch(const PatchPowers& patch, const Vec3& facing, double doubted, std::vector<Index>& guesses,
                  std::vector<Residual>& out) const;

  /// The same of further places of the patch. Cost: a search among all triangles of the target each.
  void from_places(const CubicPatch& patch, const Vec3& facing, const std::vector<Vec2>& places,
                   std::vector<Residual>& out) const;

  /// Appends what makes two neighbours gape: where their edge curves part sideways, the target is bare between them by
  /// half the way. Each side has its own residuals, towards the middle.
  /// @param from, to  corners of the edge in the patch; other  the neighbour's points at 1/4, 1/2, 3/4 of the way
  static void from_gap(const CubicPatch& patch, std::size_t from, std::size_t to, const std::array<Vec3, 3>& other,
                       std::vector<Residual>& out);

  /// Appends the residuals of points of the target against a patch, those of the boundary against its boundary edges.
  void from_target(const CubicPatch& patch, const PatchPowers& powers, const Vec3& facing, EdgeBits boundary,
                   const std::vector<Index>& points, std::vector<Residual>& out) const;

  /// Appends the residuals of points of a patch's boundary edges against the target's boundary.
  void from_boundary(const CubicPatch& patch, const Vec3& facing, EdgeBits boundary, std::vector<Residual>& out) const;

  /// The closest facet's normal and point of the target on the side of `facing`.
  [[nodiscard]] Target::Foot foot(const Vec3& p, const Vec3& facing) const;

private:
  void set_grid(int level);
  [[nodiscard]] Residual residual_of(const Vec2& at, const Vec3& p, const ClosestPoint::Hit& hit,
                                     const Vec3& facing) const;
  [[nodiscard]] ClosestPoint::Hit downhill(const Vec3& p, Index start) const;
  /// The same from the given start each, for those of the first `count` points whose foot is not within it.
  void downhill(const LaneVec3& p, std::size_t count, std::array<ClosestPoint::Hit, lane_count>& hits) const;

  const Target& target_;
  std::shared_ptr<const StartGrid> grid_of_target_;
  bool boundaries_;
  std::vector<SamplePoint> points_;
  std::vector<Vec3> further_;
  std::vector<Vec3> further_boundary_;
  int level_ = 0;  // intervals per edge of the grid of a patch's points
  std::vector<Vec2> grid_;
  std::vector<std::array<Lanes, 2>> grid_lanes_;  // the last ones repeated
};

}  // namespace tunica
