#include "tunica/fit/detail/samples.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/core/threads.hpp"
#include "tunica/surface/distance/facet_distances.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t points_per_shell = 16;  // of the target: a cubic has ten coefficients, seen from two sides
constexpr int grid_level =
    5;  // pieces per edge of a patch, or of its boundary, between its points: 21 of them, likewise
constexpr int search_level = 3;   // pieces per edge of the flat surface on which points of the target find their patch
constexpr double other_wall = 4;  // times as far: beyond that a closest point that faces away is one around a rim
constexpr double beside = 0.99;   // cosine of 8 degrees: farther off the normal a distance counts along itself

/// Along the given normal, or along the distance itself where it points elsewhere (off an edge, rim or boundary).
Residual residual(const Vec2& at, const Vec3& away, const Vec3& normal) {
  const double distance = away.norm(), along = away.dot(normal);
  if (std::abs(along) < beside * distance) {
    return {at, away / distance, distance};
  }
  return {at, normal, along < 0 ? -distance : distance};
}

/// Along the distance itself: curves meet where nothing is left of it.
Residual residual_of_curve(const Vec2& at, const Vec3& away, const Vec3& facing) {
  const double distance = away.norm();
  return {at, distance > 0 ? Vec3(away / distance) : facing, distance};
}

/// Where a curve is closest to q, nearly: Gauss-Newton steps from the best of a few places.
double foot_on_curve(const CubicCurve& curve, const Vec3& q) {
  double s = 0, least = infinity;
  for (int i = 0; i <= grid_level; ++i) {
    const double there = real(i) / grid_level;
    if (const double squared = (point_on(curve, there) - q).squaredNorm(); squared < least) {
      least = squared;
      s = there;
    }
  }
  for (;;) {
    const double r = 1 - s;
    const Vec3 tangent =
        3 * (r * r * (curve[1] - curve[0]) + 2 * r * s * (curve[2] - curve[1]) + s * s * (curve[3] - curve[2]));
    const double step = tangent.dot(q - point_on(curve, s)) / std::max(tangent.squaredNorm(), 1e-300);
    const double next = std::clamp(s + step, 0.0, 1.0);
    const double squared = (point_on(curve, next) - q).squaredNorm();
    if (!(squared < least)) {
      return s;
    }
    least = squared;
    s = next;
  }
}

/// Of a point of the target's boundary, against the closest of a patch's boundary edges.
Residual residual_on_edges(const CubicPatch& surface, const Vec3& facing, EdgeBits boundary, const Vec3& q) {
  Residual best{{}, facing, infinity};
  for (std::size_t k = 0; k < 3; ++k) {
    if ((boundary >> k & 1) != 0) {
      const CubicCurve curve = edge_curve(surface, k);
      const double s = foot_on_curve(curve, q);
      const Residual r = residual_of_curve(place_on_edge(k, s), point_on(curve, s) - q, facing);
      best = r.distance < best.distance ? r : best;
    }
  }
  return best;
}

/// The patch whose boundary edge, as a chord, is closest; none: there is no boundary edge.
FitPatch* closest_by_edge(FitPiece& piece, const Vec3& point) {
  FitPatch* closest = nullptr;
  double least = infinity;
  for (FitPatch& p : piece.patches) {
    for (std::size_t k = 0; p.boundary != 0 && k < 3; ++k) {
      if ((p.boundary >> k & 1) == 0) {
        continue;
      }
      const Vec3 &a = piece.positions[p.nodes[k]], along = piece.positions[p.nodes[(k + 1) % 3]] - a;
      const double part = std::clamp((point - a).dot(along) / std::max(along.squaredNorm(), 1e-300), 0.0, 1.0);
      if (const double squared = (point - a - part * along).squaredNorm(); squared < least) {
        least = squared;
        closest = &p;
      }
    }
  }
  return closest;
}

}  // namespace

FitSamples::FitSamples(const Target& target, std::size_t shells, bool boundaries)
    : target_(target), walk_(target.mesh()), boundaries_(boundaries && target.boundary_tree()) {
  const auto& mesh = target.mesh();
  std::vector<std::uint8_t> used(mesh.vertices.size(), 0);
  const std::size_t wanted = points_per_shell * shells;
  // A boundary is a curve: it gets its share of a square of as many points.
  const auto per_loop = 16 * truncated<std::size_t>(std::sqrt(real(shells)) + 4);
  for (const auto& loop : target.boundary_vertices()) {
    const std::size_t stride = std::max<std::size_t>(1, loop.size() / per_loop);
    for (std::size_t i = 0; i < loop.size(); i += stride) {
      points_.push_back({mesh.vertices[loop[i]], boundaries_});
      used[loop[i]] = 1;
    }
  }
  if (mesh.triangles.size() < wanted) {
    for (const auto& [a, b, c] : mesh.triangles) {
      points_.push_back({(mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3});
    }
  }
  // Every n-th triangle in the order of space: even over the surface.
  const auto& order = target.tree().spatial_order();
  const double stride = std::max(1.0, real(order.size()) / real(wanted));
  for (double i = stride / 2; i < real(order.size()); i += stride) {
    for (const Index v : mesh.triangles[order[truncated<std::size_t>(i)]]) {
      if (used[v] == 0) {
        points_.push_back({mesh.vertices[v]});
        used[v] = 1;
        break;
      }
    }
  }
  for (int i = 0; i <= grid_level; ++i) {
    for (int j = 0; i + j <= grid_level; ++j) {
      grid_.emplace_back(real(j) / grid_level, real(i) / grid_level);
    }
  }
}

void FitSamples::attach(FitMesh& mesh) const {
  std::vector<Index> patch_of;
  const Tessellation fine = tessellate_uniformly(mesh.shell(&patch_of), search_level);
  const ClosestPoint tree(fine.mesh);
  std::vector<CubicCurve> curves;
  std::vector<Index> patch_of_curve;
  for (Index t = 0; boundaries_ && t < mesh.patches.size(); ++t) {
    for (std::size_t k = 0; mesh.patches[t].boundary != 0 && k < 3; ++k) {
      if ((mesh.patches[t].boundary >> k & 1) != 0) {
        curves.push_back(edge_curve(mesh.surface(mesh.patches[t]), k));
        patch_of_curve.push_back(t);
      }
    }
  }
  std::optional<ClosestPoint> edges;
  if (!curves.empty()) {
    edges.emplace(chords_of(curves, grid_level).mesh);
  }
  std::vector<Index> found(points_.size());
  parallel_for_blocks(points_.size(), 512, [&](std::size_t begin, std::size_t end) {
    std::optional<Index> guess;
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [point, of_boundary] = points_[i];
      if (of_boundary && edges) {
        found[i] = patch_of_curve[edges->closest(point).triangle / grid_level];
        continue;
      }
      const auto hit = guess ? tree.closest(point, *guess) : tree.closest(point);
      guess = hit.triangle;
      found[i] = patch_of[fine.shell[hit.triangle]];
    }
  });
  for (FitPatch& p : mesh.patches) {
    p.attached.clear();
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    mesh.patches[found[i]].attached.push_back(narrow<Index>(i));
  }
}

void FitSamples::attach(FitPiece& piece) const {
  std::vector<FacetDistances> facets;
  facets.reserve(piece.patches.size());
  for (FitPatch& p : piece.patches) {
    facets.emplace_back(piece.corners(p));
    p.attached.clear();
  }
  std::array<Index, lane_count> group{};
  std::size_t count = 0;
  const auto attach_group = [&] {
    const LaneVec3 at =
        lane_points([&](std::size_t k) -> const Vec3& { return points_[group[std::min(k, count - 1)]].point; });
    NearestFacet nearest;
    for (std::size_t j = 0; j < facets.size(); ++j) {
      nearest.try_facet(facets[j], at, real(j));
    }
    for (std::size_t k = 0; k < count; ++k) {
      piece.patches[truncated<std::size_t>(nearest.which[k])].attached.push_back(group[k]);
    }
    count = 0;
  };
  for (const Index i : piece.points) {
    if (FitPatch* by_edge = points_[i].of_boundary ? closest_by_edge(piece, points_[i].point) : nullptr) {
      by_edge->attached.push_back(i);
      continue;
    }
    group[count++] = i;
    if (count == lane_count) {
      attach_group();
    }
  }
  if (count > 0) {
    attach_group();
  }
}

void FitSamples::measure(const FitPiece& piece, FitPatch& patch, double search_beyond) const {
  patch.residuals.clear();
  const CubicPatch surface = piece.surface(patch);
  const PatchPowers powers(surface);
  const Vec3 facing = piece.facing(patch);
  from_patch(powers, facing, search_beyond, patch);
  from_target(surface, powers, facing, patch);
  from_boundary(surface, facing, patch);
  patch.error = 0;
  for (const Residual& r : patch.residuals) {
    patch.error = std::max(patch.error, std::abs(r.distance));
  }
}

double FitSamples::measure(FitPiece& piece) const {
  const auto measure_above = [&](double least, double search_beyond) {
    parallel_for_blocks(piece.patches.size(), patches_per_block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t t = begin; t < end; ++t) {
        if (FitPatch& p = piece.patches[t]; p.is_alive() && p.error >= least) {
          measure(piece, p, search_beyond);
        }
      }
    });
    double largest = 0;
    for (const FitPatch& p : piece.patches) {
      largest = std::max(largest, p.error);
    }
    return largest;
  };
  // Downhill from a wrong start a point may seem far that is not.
  const double largest = measure_above(0, infinity);
  return measure_above(largest / 2, largest / 2);
}

void FitSamples::from_patch(const PatchPowers& powers, const Vec3& facing, double search_beyond,
                            FitPatch& patch) const {
  if (patch.guesses.size() != grid_.size()) {
    const Index first = patch.guesses.empty() ? target_.tree().closest(powers.corner()).triangle : patch.guesses[0];
    patch.guesses.assign(grid_.size(), first);
  }
  for (std::size_t i = 0; i < grid_.size(); i += lane_count) {
    const std::size_t last = grid_.size() - 1;
    const Lanes x = lanes_of([&](std::size_t k) { return grid_[std::min(i + k, last)][0]; });
    const Lanes y = lanes_of([&](std::size_t k) { return grid_[std::min(i + k, last)][1]; });
    const LaneVec3 points = powers.point(x, y);
    for (std::size_t k = 0; k < lane_count && i + k < grid_.size(); ++k) {
      const Vec3 p(points[0][k], points[1][k], points[2][k]);
      ClosestPoint::Hit hit = walk_.near_by(p, patch.guesses[i + k]);
      if (hit.squared_distance > search_beyond * search_beyond) {
        hit = target_.tree().closest(p, hit.triangle);
      }
      patch.guesses[i + k] = hit.triangle;
      patch.residuals.push_back(residual_of(grid_[i + k], p, hit, facing));
    }
  }
}

Residual FitSamples::residual_of(const Vec2& at, const Vec3& p, const ClosestPoint::Hit& hit,
                                 const Vec3& facing) const {
  const Vec3& normal = target_.facet_normals()[hit.triangle];
  if (normal.dot(facing) > 0) {
    return residual(at, p - hit.point, normal);
  }
  if (const auto foot = target_.closest_facing(p, facing, other_wall * std::sqrt(hit.squared_distance))) {
    return residual(at, p - foot->point, foot->facet_normal);
  }
  return residual_of_curve(at, p - hit.point, facing);
}

void FitSamples::from_target(const CubicPatch& surface, const PatchPowers& powers, const Vec3& facing,
                             FitPatch& patch) const {
  std::array<Index, lane_count> group{};
  std::size_t count = 0;
  const auto measure_group = [&] {
    const LaneVec3 q =
        lane_points([&](std::size_t k) -> const Vec3& { return points_[group[std::min(k, count - 1)]].point; });
    const LaneFeet feet = feet_on_patch(powers, q);
    const auto [dx, dy] = powers.tangents(feet.x, feet.y);
    const LaneVec3 normals = dx.cross(dy);
    const LaneVec3 away = feet.point - q;
    for (std::size_t k = 0; k < count; ++k) {
      const auto lane = [&](const LaneVec3& v) { return Vec3(v[0][k], v[1][k], v[2][k]); };
      const Vec3 normal = lane(normals).stableNormalized();
      patch.residuals.push_back(
          residual({feet.x[k], feet.y[k]}, lane(away), normal.squaredNorm() > 0.5 ? normal : facing));
    }
    count = 0;
  };
  for (const Index point : patch.attached) {
    if (points_[point].of_boundary && patch.boundary != 0) {
      patch.residuals.push_back(residual_on_edges(surface, facing, patch.boundary, points_[point].point));
      continue;
    }
    group[count++] = point;
    if (count == lane_count) {
      measure_group();
    }
  }
  if (count > 0) {
    measure_group();
  }
}

void FitSamples::from_boundary(const CubicPatch& surface, const Vec3& facing, FitPatch& patch) const {
  for (std::size_t k = 0; boundaries_ && k < 3; ++k) {
    if ((patch.boundary >> k & 1) == 0) {
      continue;
    }
    const CubicCurve curve = edge_curve(surface, k);
    for (int i = 0; i <= grid_level; ++i) {
      const double s = real(i) / grid_level;
      const Vec3 p = point_on(curve, s);
      patch.residuals.push_back(
          residual_of_curve(place_on_edge(k, s), p - target_.boundary_tree()->closest(p).point, facing));
    }
  }
}

Target::Foot FitSamples::foot(const Vec3& p, const Vec3& facing) const {
  const auto foot = target_.closest_facing(p, facing, target_.diagonal());
  return foot ? *foot : target_.closest(p);
}

}  // namespace tunica
