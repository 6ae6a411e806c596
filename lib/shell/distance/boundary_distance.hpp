// shell/distance: certified distances of the curved surface to a target.
#pragma once

#include "tunica/shell/distance/target.hpp"
#include "tunica/shell/patch/curved_surface.hpp"

#include <optional>
#include <span>

/// How far the boundary curves of shells and of their target lie apart. The distance of the surfaces says little about
/// that where a boundary winds: a bay narrower than the distance may be filled, a spit missing.
namespace tunica {

/// The control points of a cubic Bezier curve.
using CubicCurve = std::array<Vec3, 4>;

/// Which edges of a patch are boundary edges: bit k for the one from corner k to k + 1.
using EdgeBits = std::uint8_t;

/// The edge of a patch from corner k to k + 1.
CubicCurve edge_curve(const CubicPatch& patch, std::size_t k);

/// The point of a curve at s in [0, 1].
Vec3 point_on(const CubicCurve& curve, double s);

/// Parameters of a patch at a part s of the way from corner k to k + 1.
Vec2 place_on_edge(std::size_t k, double s);

/// The boundary edges of a shell mesh.
std::vector<CubicCurve> boundary_curves(const ShellMesh& shell);

/// Curves as chords, each of as many pieces, see segments_as_triangles().
struct Chords {
  TriangleMesh mesh;
  int pieces;  ///< per curve: triangle i belongs to curve i / pieces
};
Chords chords_of(std::span<const CubicCurve> curves, int pieces);

struct BoundaryDistance {
  Interval both;             ///< mm, two-sided Hausdorff distance of the curves
  Interval shell_to_target;  ///< mm
  Interval target_to_shell;  ///< mm
  /// Points of the target's boundary: the closest to the farthest point of the shells', and the farthest itself.
  std::array<Vec3, 2> farthest;
};

/// Certified: hausdorff() of chords so fine that what they are off is part of the interval.
/// @param curves  all boundary edges of the shells; @param width  mm, upper - lower wanted; @param limit  mm: whether
/// the distance is at most this is all that matters
/// @return nothing where either has no boundary
/// Cost: about 5 us per segment of the target's boundary and per chord.
std::optional<BoundaryDistance> boundary_distance(std::span<const CubicCurve> curves, const Target& target,
                                                  double width, std::optional<double> limit = {});

}  // namespace tunica
