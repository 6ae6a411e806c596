#pragma once

#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/contact/contact_system.hpp"

#include <algorithm>
#include <optional>

/// Faces, their parts and where they are, for the files of ContactSystem alone.
namespace tunica {

inline constexpr int most_refined = 5;         ///< times that a part is split for a certificate
inline constexpr double same_distance = 1e-9;  ///< of a wall: what touches does not overlap

struct Bounds {
  Vec3 lower, upper;

  [[nodiscard]] bool meets(const Bounds& other, double more) const {
    return ((lower.array() - more) <= other.upper.array()).all() &&
           ((other.lower.array() - more) <= upper.array()).all();
  }
};

/// A box around the curved face.
inline Bounds bounds_of(const SurfaceFace& face, const PatchMap& map) {
  // The surface lies in the hull of its control points; the centre follows them by weights that may leave it a little.
  const auto points = map.points().leftCols(face.curved ? 9 : 3);
  Bounds bounds{points.rowwise().minCoeff(), points.rowwise().maxCoeff()};
  if (face.curved) {
    Vec3 centre = Vec3::Zero();
    for (int k = 0; k < 9; ++k) {
      centre += face.centre[k] * points.col(k);
    }
    bounds.lower = bounds.lower.cwiseMin(centre);
    bounds.upper = bounds.upper.cwiseMax(centre);
  }
  return bounds;
}

/// Of the flat triangle of the corners; of a solid it points outward.
inline Vec3 facet_normal(const PatchMap& map) {
  const auto& p = map.points();
  return (p.col(1) - p.col(0)).cross(p.col(2) - p.col(0)).normalized();
}

/// The face as a cubic patch, for flatness().
inline CubicPatch patch_of(const SurfaceFace& face, const PatchMap& map) {
  CubicPatch patch;
  patch.control[9].setZero();
  for (int k = 0; k < 9; ++k) {
    patch.control[k] = map.points().col(k);
    patch.control[9] += face.centre[k] * map.points().col(k);
  }
  return patch;
}

/// Parts of a face: triangles of its parameters.
struct Part {
  std::array<Vec2, 3> at;

  [[nodiscard]] std::array<Part, 4> split() const {
    const Vec2 a = (at[0] + at[1]) / 2, b = (at[1] + at[2]) / 2, c = (at[2] + at[0]) / 2;
    return {Part{{at[0], a, c}}, Part{{a, at[1], b}}, Part{{c, b, at[2]}}, Part{{b, c, a}}};
  }
};

/// level^2 parts of the same shape.
inline std::vector<Part> parts_of(int level) {
  std::vector<Part> parts;
  for (int i = 0; i < level; ++i) {
    for (int j = 0; i + j < level; ++j) {
      const auto at = [&](int x, int y) { return Vec2(real(x) / level, real(y) / level); };
      parts.push_back({{at(i, j), at(i + 1, j), at(i, j + 1)}});
      if (i + j + 1 < level) {
        parts.push_back({{at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}});
      }
    }
  }
  return parts;
}

/// Smallest and largest of n.x over the corners of a part.
inline std::array<double, 2> extent(const SurfaceFace& face, const PatchMap& map, const Part& part, const Vec3& n) {
  std::array<double, 2> range{infinity, -infinity};
  for (const Vec2& at : part.at) {
    const double value = n.dot(map.point(patch_weights(face, at)));
    range = {std::min(range[0], value), std::max(range[1], value)};
  }
  return range;
}

/// Parameters of a part's middle.
inline Vec2 middle(const Part& part) { return (part.at[0] + part.at[1] + part.at[2]) / 3; }

/// The faces in a configuration, each made when it is asked for, and kept.
class FaceMaps {
public:
  FaceMaps(const Surfaces& surfaces, const std::vector<Vec3>& reference, Configuration configuration)
      : surfaces_(surfaces),
        reference_(reference),
        configuration_(std::move(configuration)),
        maps_(surfaces.faces.size()),
        bounds_(maps_.size()) {}

  [[nodiscard]] const Configuration& configuration() const { return configuration_; }
  [[nodiscard]] bool are_at(const Configuration& other) const {
    const auto same = [](const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) { return a.coeffs() == b.coeffs(); };
    return configuration_.displacement == other.displacement &&
           std::equal(configuration_.rotation.begin(), configuration_.rotation.end(), other.rotation.begin(),
                      other.rotation.end(), same);
  }
  [[nodiscard]] PatchMap& operator[](std::size_t face) const {
    if (!maps_[face]) {
      maps_[face] = PatchMap(surfaces_.faces[face], reference_, configuration_);
    }
    return *maps_[face];
  }
  [[nodiscard]] const Bounds& bounds(std::size_t face) const {
    prepare(face);
    return bounds_[face]->first;
  }
  /// How far the surface may be from its flat facet, mm.
  [[nodiscard]] double bend(std::size_t face) const {
    prepare(face);
    return bounds_[face]->second;
  }
  /// Makes map and bounds: what is prepared may be asked for in parallel.
  void prepare(std::size_t face) const {
    if (!bounds_[face]) {
      const SurfaceFace& of = surfaces_.faces[face];
      const PatchMap& map = (*this)[face];
      bounds_[face] = {bounds_of(of, map), of.curved ? flatness(patch_of(of, map), 1) : 0.0};
    }
  }
  [[nodiscard]] PatchMap& linearised(std::size_t face) const {
    PatchMap& map = (*this)[face];
    map.linearise();
    return map;
  }

private:
  const Surfaces& surfaces_;
  const std::vector<Vec3>& reference_;
  const Configuration configuration_;
  mutable std::vector<std::optional<PatchMap>> maps_;
  mutable std::vector<std::optional<std::pair<Bounds, double>>> bounds_;
};

}  // namespace tunica
