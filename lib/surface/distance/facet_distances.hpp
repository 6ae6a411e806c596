#pragma once

#include "tunica/core/lanes.hpp"
#include "tunica/core/types.hpp"

#include <array>

namespace tunica {

/// A flat triangle made ready for its squared distances from several points at once. Rounding as usual, no bound; never
/// less than the distance to some point of the triangle, however thin it is.
class FacetDistances {
public:
  explicit FacetDistances(const std::array<Vec3, 3>& corners)
      : a_(corners[0]),
        ab_(corners[1] - corners[0]),
        ac_(corners[2] - corners[0]),
        uu_(ab_.dot(ab_)),
        uv_(ab_.dot(ac_)),
        vv_(ac_.dot(ac_)),
        inverse_ab_(inverse_or_zero(uu_)),
        inverse_ac_(inverse_or_zero(vv_)),
        inverse_bc_(inverse_or_zero(uu_ - 2 * uv_ + vv_)),
        inverse_determinant_(inverse_or_zero(uu_ * vv_ - uv_ * uv_)) {}

  [[nodiscard]] Lanes squared_distance(const LaneVec3& p) const {
    const Lanes x = p[0] - a_[0], y = p[1] - a_[1], z = p[2] - a_[2];
    const auto squared_at = [&](const Lanes& s, const Lanes& t) {
      const Lanes dx = x - s * ab_[0] - t * ac_[0];
      const Lanes dy = y - s * ab_[1] - t * ac_[1];
      const Lanes dz = z - s * ab_[2] - t * ac_[2];
      return Lanes(dx * dx + dy * dy + dz * dz);
    };
    const auto within = [](const Lanes& part) { return Lanes(simd::min(simd::max(part, Lanes(0.0)), Lanes(1.0))); };
    const Lanes pu = x * ab_[0] + y * ab_[1] + z * ab_[2];
    const Lanes pv = x * ac_[0] + y * ac_[1] + z * ac_[2];
    const Lanes on_bc = within((pv - pu + (uu_ - uv_)) * inverse_bc_);
    Lanes least = simd::min(squared_at(within(pu * inverse_ab_), 0.0), squared_at(0.0, within(pv * inverse_ac_)));
    least = simd::min(least, squared_at(1.0 - on_bc, on_bc));
    const Lanes s = (vv_ * pu - uv_ * pv) * inverse_determinant_;
    const Lanes t = (uu_ * pv - uv_ * pu) * inverse_determinant_;
    simd::where(s > 0.0 && t > 0.0 && s + t < 1.0, least) = simd::min(least, squared_at(s, t));
    return least;
  }

private:
  static double inverse_or_zero(double x) { return x > 0 ? 1 / x : 0; }

  Vec3 a_, ab_, ac_;
  double uu_, uv_, vv_;
  double inverse_ab_, inverse_ac_, inverse_bc_, inverse_determinant_;  // zero where there is no length or no area
};

/// The nearest of some triangles to each of several points.
struct NearestFacet {
  Lanes squared = infinity;
  Lanes which = 0.0;  ///< its number

  void try_facet(const FacetDistances& facet, const LaneVec3& p, double number) {
    const Lanes distance = facet.squared_distance(p);
    const LaneMask nearer = distance < squared;
    simd::where(nearer, squared) = distance;
    simd::where(nearer, which) = number;
  }
};

}  // namespace tunica
