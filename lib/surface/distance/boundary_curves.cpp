#include "tunica/surface/distance/boundary_curves.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/checks.hpp"
#include "tunica/surface/mesh/incidence.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {

TriangleMesh segments_as_triangles(const std::vector<std::array<Vec3, 2>>& segments) {
  TriangleMesh out;
  out.vertices.reserve(2 * segments.size());
  out.triangles.reserve(segments.size());
  for (const auto& [a, b] : segments) {
    const auto first = narrow<Index>(out.vertices.size());
    out.vertices.push_back(a);
    out.vertices.push_back(b);
    out.triangles.push_back({first, first + 1, first + 1});
  }
  return out;
}

BoundaryCurves::BoundaryCurves(const TriangleMesh& mesh) {
  require_valid(mesh);
  for (const auto& loop : boundary_loops(mesh)) {
    Curve curve;
    double length = 0;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      curve.points.push_back(mesh.vertices[loop[i]]);
      curve.at.push_back(length);
      length += (mesh.vertices[loop[(i + 1) % loop.size()]] - mesh.vertices[loop[i]]).norm();
    }
    curve.at.push_back(length);
    curves_.push_back(std::move(curve));
  }
}

Index BoundaryCurves::curve_of(const std::vector<Vec3>& loop) const {
  Index best = 0;
  double least = infinity;
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    double farthest = 0;
    for (const Vec3& p : loop) {
      farthest = std::max(farthest, (p - point(nearest(p, narrow<Index>(c)))).norm());
      if (farthest >= least) {
        break;
      }
    }
    if (farthest < least) {
      least = farthest;
      best = narrow<Index>(c);
    }
  }
  return best;
}

BoundaryCurves::Place BoundaryCurves::nearest(const Vec3& p, Index index) const {
  const Curve& curve = curves_[index];
  Place best{index, 0};
  double least = infinity;
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const Vec3& a = curve.points[i];
    const Vec3 edge = curve.points[(i + 1) % curve.points.size()] - a;
    const double squared_length = edge.squaredNorm();
    const double t = squared_length > 0 ? std::clamp((p - a).dot(edge) / squared_length, 0.0, 1.0) : 0;
    const double squared = (p - a - t * edge).squaredNorm();
    if (squared < least) {
      least = squared;
      best.at = std::min(curve.at[i] + t * (curve.at[i + 1] - curve.at[i]), curve.at.back());
    }
  }
  return best;
}

Vec3 BoundaryCurves::point(const Place& place) const {
  const Curve& curve = curves_[place.curve];
  const auto after = std::upper_bound(curve.at.begin(), curve.at.end() - 1, place.at);
  const std::size_t i = std::max<std::ptrdiff_t>(after - curve.at.begin() - 1, 0);
  const Vec3& a = curve.points[i];
  const double length = curve.at[i + 1] - curve.at[i];
  const double t = length > 0 ? std::clamp((place.at - curve.at[i]) / length, 0.0, 1.0) : 0;
  return a + t * (curve.points[(i + 1) % curve.points.size()] - a);
}

BoundaryCurves::Place BoundaryCurves::between(const Place& a, const Place& b, double fraction) const {
  const double length = curves_[a.curve].at.back();
  double end = b.at;
  if (end <= a.at) {
    end += length;
  }
  const double at = a.at + fraction * (end - a.at);
  return {a.curve, at >= length ? at - length : at};
}

}  // namespace tunica
