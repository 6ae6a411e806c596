#pragma once

#include "shell/fit_samples.hpp"

#include <limits>
#include <optional>

namespace tunica {

/// What a facet must keep, unless it was worse before.
struct FitLimits {
  double agreement = 0.3;                ///< N·n at its corners
  double angle = 20;                     ///< degrees
  double kink = 0;                       ///< degrees by which normals of one node and sector may part
  std::size_t price_of_a_thin_one = 10;  ///< shells that a triangle with a smaller angle may cost to be rid of
};

/// The angle, degrees, that a facet must keep whose smallest angle is `now`: the limit, or nearly what it has.
double least_angle(double limit, double now);

/// How the ten control points of a patch follow its corners (x, y, z of each: columns 0..8) and the tilts of its
/// normals along tilt_axes() (two of each: columns 9..14). Rows: x, y, z of control point 0, then of 1, ...
using PatchJacobian = Eigen::Matrix<double, 30, 15>;
PatchJacobian patch_jacobian(const PatchShape& shape);

/// The same for one corner alone: x, y, z, and the two tilts of its normal.
Eigen::Matrix<double, 30, 5> corner_jacobian(const PatchShape& shape, std::size_t corner);

/// How the control points of a patch with creases follow the tilts of the normals across: of the start and the end of
/// edge 1-2, then of 2-3 and 3-1, two columns each.
Eigen::Matrix<double, 30, 12> across_jacobian(const PatchShape& shape);

/// The two directions in which a unit normal tilts.
std::array<Vec3, 2> tilt_axes(const Vec3& normal);

/// Turns those of the normals that are of one sector towards their mean where they part by more than `kink` degrees.
/// @param normals  unit; @param sectors  of each normal
void hold_together(std::vector<Vec3>& normals, const std::vector<Index>& sectors, double kink);

/// Unit normal of a facet; zero without area.
Vec3 facing_of(const std::array<Vec3, 3>& corners);

/// Whether a facet has area, agreeing normals and angles.
bool is_sound(const PatchShape& shape, double agreement, double angle);

/// One of the patches around a node that is being placed.
struct PlacedPatch {
  PatchShape shape;
  std::size_t corner = no_corner;           ///< which corner is the node; no_corner: none, the patch is only measured
  std::size_t slot = 0;                     ///< which of the node's normals it has there
  std::array<std::size_t, 2> beside{0, 0};  ///< where shape.across is: those across the edges that leave and arrive
  /// By edge (corner k to k + 1): what a comas patch may gape at. A patch of the same list by its number, or the points
  /// of a patch that stays as it is (see edge_points), in this patch's direction.
  struct Across {
    std::size_t patch = none;
    std::size_t from = 0, to = 0;  ///< the edge's ends in that patch, in this patch's direction
    std::optional<std::array<Vec3, 3>> points;
    static constexpr std::size_t none = static_cast<std::size_t>(-1);
  };
  std::array<Across, 3> across;
  EdgeBits boundary = 0;  ///< edges with nothing across, which belong on the target's boundary
  std::vector<Index> guesses;
  std::vector<Index> attached;
  std::vector<Residual> residuals;
  double error = 0;
  static constexpr std::size_t no_corner = 3;
};

/// A node that is looking for its place.
struct PlacedNode {
  Vec3 position = Vec3::Zero();
  std::vector<Vec3> normals;   ///< one per slot
  std::vector<Index> sectors;  ///< likewise, see FitMesh
  double error = std::numeric_limits<double>::infinity();
};

/// Moves one node and turns its normals so that the patches around it come closest to the target: Gauss-Newton steps
/// on the squares, then on the eighth powers of the residuals. Tangentially the node is held the more the better the
/// patches fit.
/// @param patches   out: as they are with the node at its best, with what is attached to them and their residuals
/// @param node      in: where to start; out: the best, error = largest residual of all patches; infinite when the
///                  patches are not sound there
/// @param points    of the target, to be attached each to the patch whose facet is closest
/// @param give_up   mm: an error that stays far above this ends the work
/// @param far       mm: an error above this, though not above give_up, after any of the steps ends it, too
void place_node(const FitSamples& samples, std::vector<PlacedPatch>& patches, const std::vector<Index>& points,
                const FitLimits& limits, double give_up, int steps, PlacedNode& node,
                double far = std::numeric_limits<double>::infinity());

/// Turns the three normals of one patch, as if they were its own, so that it alone comes closest to the target.
/// @param patch  in: shape, attached points, what lies across; out: the best, error and residuals
void turn_normals(const FitSamples& samples, PlacedPatch& patch, const FitLimits& limits, int steps);

}  // namespace tunica
