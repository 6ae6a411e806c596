#include "tunica/shell/distance/patch_search.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int coarse_level = 4;      // pieces per edge of the patches where near() starts
constexpr std::size_t fan_out = 16;  // boxes per box
constexpr int newton_steps = 6;
constexpr double on_edge = 1e-9;  // of a patch's parameters
constexpr int deepest = 20;       // halvings of a patch

Box around(const Box& a, const Box& b) { return {a.lower.cwiseMin(b.lower), a.upper.cwiseMax(b.upper)}; }

double distance_to(const Box& box, const Vec3& p) { return (box.lower - p).cwiseMax(p - box.upper).cwiseMax(0).norm(); }

Box box_of(const CubicPatch& patch) {
  Box box{patch.control[0], patch.control[0]};
  for (const Vec3& p : patch.control) {
    box = around(box, {p, p});
  }
  return box;
}

/// Weights of the corners at a point of a triangle.
Vec3 weights_in(const std::array<Vec3, 3>& c, const Vec3& p) {
  const Vec3 u = c[1] - c[0], v = c[2] - c[0], w = p - c[0];
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), wu = w.dot(u), wv = w.dot(v);
  const double determinant = std::max(uu * vv - uv * uv, 1e-300);
  Vec3 out(0, std::clamp((vv * wu - uv * wv) / determinant, 0.0, 1.0),
           std::clamp((uu * wv - uv * wu) / determinant, 0.0, 1.0));
  const double sum = out.sum();
  if (sum > 1) {
    out /= sum;
  }
  out[0] = 1 - out[1] - out[2];
  return out;
}

SurfaceFoot surface_foot(Index patch, const PatchFoot& foot) {
  return {patch, foot.at, foot.point, std::sqrt(foot.squared_distance)};
}

}  // namespace

PatchSearch::PatchSearch(const ShellMesh& shell, const std::vector<CubicPatch>& patches)
    : patches_(patches), coarse_(tessellate_uniformly(shell, coarse_level)), tree_(coarse_.mesh) {
  const TriangleMesh flat = flat_facets(shell);
  across_ = neighbours(flat, incidence(flat));
  std::vector<std::uint8_t> met(patches.size(), 0);
  for (const Index fine : tree_.spatial_order()) {
    const Index t = coarse_.shell[fine];
    if (met[t] == 0) {
      met[t] = 1;
      order_.push_back(t);
    }
  }
  auto& boxes = levels_.emplace_back();
  for (const Index t : order_) {
    boxes.push_back(box_of(patches[t]));
  }
  while (levels_.back().size() > 1) {
    std::vector<Box> above;
    const auto& below = levels_.back();
    for (std::size_t i = 0; i < below.size(); ++i) {
      if (i % fan_out == 0) {
        above.push_back(below[i]);
      } else {
        above.back() = around(above.back(), below[i]);
      }
    }
    levels_.push_back(std::move(above));
  }
  for (const CubicPatch& patch : patches) {
    flatness_.push_back(flatness(patch, 1));
    axes_.emplace_back(patch);
  }
}

SurfaceFoot PatchSearch::near(const Vec3& p, std::optional<Index>& guess) const {
  const auto hit = guess ? tree_.closest(p, *guess) : tree_.closest(p);
  guess = hit.triangle;
  const Vec3 weights = weights_in(tree_.corners(hit.triangle), hit.point);
  Vec2 start = Vec2::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    start += weights[k] * coarse_.barycentric[coarse_.mesh.triangles[hit.triangle][k]];
  }
  return near(p, coarse_.shell[hit.triangle], start);
}

SurfaceFoot PatchSearch::near(const Vec3& p, Index patch, const Vec2& start) const {
  SurfaceFoot best = on_patch(p, patch, start);
  const std::array<double, 3> weight{1 - best.at[0] - best.at[1], best.at[0], best.at[1]};
  for (std::size_t k = 0; k < 3; ++k) {
    const Index other = across_[patch][k];
    if (weight[(k + 2) % 3] <= on_edge && other != no_neighbour) {
      const SurfaceFoot there = on_patch(p, other);
      if (there.distance < best.distance) {
        best = there;
      }
    }
  }
  return best;
}

SurfaceFoot PatchSearch::on_patch(const Vec3& p, Index patch) const {
  const auto& c = patches_[patch].control;
  const Vec3 weights = weights_in({c[0], c[1], c[2]}, closest_point_on_triangle(p, c[0], c[1], c[2]));
  return on_patch(p, patch, Vec2(weights[1], weights[2]));
}

SurfaceFoot PatchSearch::on_patch(const Vec3& p, Index patch, const Vec2& start) const {
  return surface_foot(patch, foot_on_patch(axes_[patch], p, start, newton_steps));
}

double PatchSearch::bulge(Index patch, const Vec2& a, const Vec2& b, const Vec2& c) const {
  const auto longest = [](const Vec2& e) { return std::max({std::abs(e[0]), std::abs(e[1]), std::abs(e[0] + e[1])}); };
  const double reach = std::max({longest(b - a), longest(c - b), longest(a - c)});
  // flatness() of the whole patch is at least 3/4 of M, the largest second difference along one of its edges. Along
  // (x, y) it is at most (|x (x + y)| + |y (x + y)| + |x y|) M <= 3 reach^2 M, and the error of interpolation at most
  // that: the sum of 3 l_i l_j over the edges is at most 1.
  return 4 * reach * reach * flatness_[patch];
}

std::size_t PatchSearch::edge_towards(Index patch, Index other) const {
  const auto& across = across_[patch];
  return std::find(across.begin(), across.end(), other) - across.begin();
}

double PatchSearch::nearest(const Vec3& p, double tolerance, SurfaceFoot& foot) const {
  double lower = infinity;
  search_box(levels_.size() - 1, 0, p, tolerance, foot, lower);
  return std::max(0.0, std::min(lower, foot.distance - tolerance));
}

void PatchSearch::search_box(std::size_t level, std::size_t box, const Vec3& p, double tolerance, SurfaceFoot& foot,
                             double& lower) const {
  if (distance_to(levels_[level][box], p) >= foot.distance - tolerance) {
    return;
  }
  if (level == 0) {
    search_patch(order_[box], p, tolerance, foot, lower);
    return;
  }
  for (std::size_t i = fan_out * box; i < std::min(fan_out * (box + 1), levels_[level - 1].size()); ++i) {
    search_box(level - 1, i, p, tolerance, foot, lower);
  }
}

void PatchSearch::search_patch(Index patch, const Vec3& p, double tolerance, SurfaceFoot& foot, double& lower) const {
  if (const SurfaceFoot here = on_patch(p, patch); here.distance < foot.distance) {
    foot = here;
  }
  const auto& c = patches_[patch].control;
  search_part(patch, {{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}, {c[0], c[1], c[2]}, flatness_[patch]}, 0, p, tolerance,
              foot, lower);
}

void PatchSearch::search_part(Index patch, const Part& part, int depth, const Vec3& p, double tolerance,
                              SurfaceFoot& foot, double& lower) const {
  const double chord = (closest_point_on_triangle(p, part.point[0], part.point[1], part.point[2]) - p).norm();
  if (chord - part.bulge >= foot.distance - tolerance) {
    return;
  }
  if (part.bulge <= tolerance / 2 || depth == deepest) {
    // Nearly flat: its foot is one of the surface's.
    lower = std::min(lower, chord - part.bulge);
    const Vec3 weights = weights_in(part.point, p);
    const Vec2 start = weights[0] * part.at[0] + weights[1] * part.at[1] + weights[2] * part.at[2];
    if (const PatchFoot here = foot_on_patch(axes_[patch], p, start, newton_steps);
        here.squared_distance < foot.distance * foot.distance) {
      foot = surface_foot(patch, here);
    }
    return;
  }
  Part middle{{}, {}, part.bulge / 4};
  for (std::size_t i = 0; i < 3; ++i) {
    middle.at[i] = (part.at[i] + part.at[(i + 1) % 3]) / 2;
    middle.point[i] = patches_[patch].point(middle.at[i]);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t before = (i + 2) % 3;  // middle i follows corner i, middle `before` precedes it
    search_part(patch,
                {{part.at[i], middle.at[i], middle.at[before]},
                 {part.point[i], middle.point[i], middle.point[before]},
                 middle.bulge},
                depth + 1, p, tolerance, foot, lower);
  }
  search_part(patch, middle, depth + 1, p, tolerance, foot, lower);
}

}  // namespace tunica
