#include "tunica/shell/distance/boundary_distance.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/require.hpp"
#include "tunica/surface/distance/boundary_curves.hpp"
#include "tunica/surface/distance/hausdorff.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr double part_for_chords = 0.2;  // of the width, on either side of what is measured between them
constexpr int most_pieces = 4096;        // of a curve

/// mm: how far a curve of one chord leaves it at most, at equal parameters; n chords leave n^2 times less.
double bulge(const CubicCurve& c) {
  return 0.75 * std::max((c[0] - 2 * c[1] + c[2]).norm(), (c[1] - 2 * c[2] + c[3]).norm());
}

}  // namespace

CubicCurve edge_curve(const CubicPatch& patch, std::size_t k) {
  const auto& c = patch.control;
  return {c[k], c[3 + 2 * k], c[4 + 2 * k], c[(k + 1) % 3]};
}

Vec3 point_on(const CubicCurve& c, double s) {
  const double r = 1 - s;
  return r * r * r * c[0] + 3 * r * r * s * c[1] + 3 * r * s * s * c[2] + s * s * s * c[3];
}

Vec2 place_on_edge(std::size_t k, double s) {
  const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  return (1 - s) * corners[k] + s * corners[(k + 1) % 3];
}

std::vector<CubicCurve> boundary_curves(const ShellMesh& shell) {
  require_valid(shell);
  const auto edges = boundary_edges(neighbours(flat_facets(shell), incidence(flat_facets(shell))));
  std::vector<CubicCurve> curves;
  if (!edges.empty()) {
    const auto patches = curved_patches(shell);
    for (const auto& [t, k] : edges) {
      curves.push_back(edge_curve(patches[t], k));
    }
  }
  return curves;
}

Chords chords_of(std::span<const CubicCurve> curves, int pieces) {
  if (pieces < 1) {
    throw InputError("a curve has one chord at least");
  }
  std::vector<std::array<Vec3, 2>> segments;
  segments.reserve(curves.size() * narrow<std::size_t>(pieces));
  for (const CubicCurve& curve : curves) {
    Vec3 last = curve[0];
    for (int i = 1; i <= pieces; ++i) {
      const Vec3 next = i == pieces ? curve[3] : point_on(curve, real(i) / pieces);
      segments.push_back({last, next});
      last = next;
    }
  }
  return {segments_as_triangles(segments), pieces};
}

std::optional<BoundaryDistance> boundary_distance(std::span<const CubicCurve> curves, const Target& target,
                                                  double width, std::optional<double> limit) {
  require_positive(width, "the width of the interval");
  if (curves.empty() || !target.boundary_tree()) {
    return {};
  }
  double largest = 0;
  for (const CubicCurve& curve : curves) {
    largest = std::max(largest, bulge(curve));
    if (!std::all_of(curve.begin(), curve.end(), [](const Vec3& p) { return p.allFinite(); })) {
      throw InputError("a boundary curve is not finite");
    }
  }
  const double needed = std::ceil(std::sqrt(largest / (part_for_chords * width)));
  const Chords chords = chords_of(curves, truncated<int>(std::clamp(needed, 1.0, real(most_pieces))));
  HausdorffOptions measuring;
  measuring.samples = 0;
  measuring.limit = limit;
  measuring.deviation_a = largest / (chords.pieces * chords.pieces);
  measuring.width = std::max(width - 2 * measuring.deviation_a, part_for_chords * width);
  const HausdorffResult found = hausdorff(ClosestPoint(chords.mesh), *target.boundary_tree(), measuring);
  const auto on_target = [&](const Vec3& p) { return target.boundary_tree()->closest(p).point; };
  return BoundaryDistance{found.both, found.a_to_b, found.b_to_a, {on_target(found.worst_a), on_target(found.worst_b)}};
}

}  // namespace tunica
