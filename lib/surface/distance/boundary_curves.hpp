// surface/distance: closest points and certified Hausdorff distances of flat surfaces.
#pragma once

#include "tunica/surface/mesh/triangle_mesh.hpp"

namespace tunica {

/// Segments as triangles without width, (a, b, b): what measures surfaces measures curves so.
TriangleMesh segments_as_triangles(const std::vector<std::array<Vec3, 2>>& segments);

/// The boundary loops of a surface as closed polylines with places on them, measured by length.
class BoundaryCurves {
public:
  struct Place {
    Index curve = 0;
    double at = 0;  ///< mm along the curve from its first point, in [0, length)
  };

  explicit BoundaryCurves(const TriangleMesh& mesh);

  [[nodiscard]] bool empty() const { return curves_.empty(); }

  /// The curve that a loop of points lies on: of which it is nowhere far.
  [[nodiscard]] Index curve_of(const std::vector<Vec3>& loop) const;

  [[nodiscard]] Place nearest(const Vec3& point, Index curve) const;
  [[nodiscard]] Vec3 point(const Place& place) const;

  /// The place a fraction of the way forward from a to b (of the same curve).
  [[nodiscard]] Place between(const Place& a, const Place& b, double fraction) const;

private:
  struct Curve {
    std::vector<Vec3> points;
    std::vector<double> at;  // of each point, and the whole length
  };
  std::vector<Curve> curves_;
};

}  // namespace tunica
