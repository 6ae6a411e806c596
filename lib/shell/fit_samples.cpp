#include "shell/fit_samples.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr std::size_t points_per_shell = 16;      // of the target, about
constexpr std::size_t most_grid_points = 22'000;  // of all patches: few large patches get a finer grid
constexpr std::size_t most_further_points = 200'000;
constexpr int coarsest_grid = 4, coarsest_on_facets = 6;
constexpr std::size_t smooth_from = 64;  // triangles of the target per shell: fewer are felt
constexpr int finest_grid = 8;
constexpr int level_of_pieces = 6;  // at least: coarser ones see too little of what condensing makes of patches
constexpr double other_wall = 4;    // times as far: beyond that a closest point that faces away is one around a rim
constexpr double arrival = 1e-6;    // in a patch's parameters: a step to the foot that is the last
constexpr int most_steps = 12;      // downhill, from triangle to triangle
constexpr double closer = 1 - 1e-9;
constexpr int gauss_newton_steps = 2;
constexpr double beside = 0.7;  // cosine: farther off the normal than this, a distance counts along itself

constexpr int edge_starts = 4, edge_steps = 4;  // of the search for the foot on an edge
constexpr int points_per_edge = 4;              // of the boundary: pieces between them

Vec2 on_edge(std::size_t from, std::size_t to, double s) {
  const std::array<Vec2, 3> corners{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  return (1 - s) * corners[from] + s * corners[to];
}

Vec2 inside(Vec2 b) {
  b = b.cwiseMax(0);
  const double sum = b[0] + b[1];
  return sum > 1 ? Vec2(b / sum) : b;
}

double dot(const Lanes& a, const Lanes& b) { return std::experimental::reduce(a * b); }

struct TriangleFoot {
  Vec3 point;
  double squared_distance;
  std::size_t side;  // k: on the edge from corner k to k + 1; 3 + k: corner k; inside
  static constexpr std::size_t inside = 6;
};

/// The point of a triangle closest to p.
TriangleFoot foot_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double uu = ab.squaredNorm(), uv = ab.dot(ac), vv = ac.squaredNorm(), pu = ap.dot(ab), pv = ap.dot(ac);
  const double determinant = uu * vv - uv * uv;
  const double s = vv * pu - uv * pv, t = uu * pv - uv * pu;
  if (s > 0 && t > 0 && s + t < determinant) {
    const Vec3 point = a + (s / determinant) * ab + (t / determinant) * ac;
    return {point, (p - point).squaredNorm(), TriangleFoot::inside};
  }
  TriangleFoot best{a, std::numeric_limits<double>::infinity(), 0};
  const std::array<const Vec3*, 3> corner{&a, &b, &c};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 edge = *corner[(k + 1) % 3] - *corner[k];
    const double part = std::clamp((p - *corner[k]).dot(edge) / std::max(edge.squaredNorm(), 1e-300), 0.0, 1.0);
    const Vec3 point = *corner[k] + part * edge;
    const double squared = (p - point).squaredNorm();
    if (squared < best.squared_distance) {
      best = {point, squared, part <= 0 ? 3 + k : part >= 1 ? 3 + (k + 1) % 3 : k};
    }
  }
  return best;
}

std::vector<Vec3> points_in_spatial_order(const Target& target) {
  const TriangleMesh& mesh = target.mesh();
  const bool few = mesh.triangles.size() < most_further_points / 4;
  const std::size_t stride = std::max<std::size_t>(1, mesh.vertices.size() / most_further_points);
  std::vector<Vec3> points;
  std::vector<std::uint8_t> met(mesh.vertices.size(), 0);
  std::size_t vertices = 0;
  for (const Index t : target.tree().spatial_order()) {
    const auto& corners = mesh.triangles[t];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& here = mesh.vertices[corners[k]];
      if (met[corners[k]] == 0) {
        met[corners[k]] = 1;
        if (vertices++ % stride == 0) {
          points.push_back(here);
        }
      }
      if (few && (target.across()[t][k] == no_neighbour || target.across()[t][k] > t)) {
        points.emplace_back((here + mesh.vertices[corners[(k + 1) % 3]]) / 2);
      }
    }
    if (few) {
      points.emplace_back((mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3);
    }
  }
  return points;
}

/// Along the given normal, or along the distance itself where it points elsewhere (off an edge, rim or boundary).
Residual residual(const Vec2& at, const Vec3& away, const Vec3& normal) {
  const double distance = away.norm();
  const double along = away.dot(normal);
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
  double s = 0, least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= edge_starts; ++i) {
    const double there = static_cast<double>(i) / edge_starts;
    if (const double squared = (point_on(curve, there) - q).squaredNorm(); squared < least) {
      least = squared;
      s = there;
    }
  }
  for (int i = 0; i < edge_steps; ++i) {
    const double r = 1 - s;
    const Vec3 tangent =
        3 * (r * r * (curve[1] - curve[0]) + 2 * r * s * (curve[2] - curve[1]) + s * s * (curve[3] - curve[2]));
    const double step = tangent.dot(q - point_on(curve, s)) / std::max(tangent.squaredNorm(), 1e-300);
    const double next = std::clamp(s + step, 0.0, 1.0);
    const double squared = (point_on(curve, next) - q).squaredNorm();
    if (squared >= least) {
      break;
    }
    least = squared;
    s = next;
  }
  return s;
}

/// Of a point of the target's boundary, against the closest of a patch's boundary edges.
Residual residual_on_edges(const CubicPatch& patch, const Vec3& facing, EdgeBits boundary, const Vec3& q) {
  Residual best{{}, facing, std::numeric_limits<double>::infinity()};
  for (std::size_t k = 0; k < 3; ++k) {
    if ((boundary >> k & 1) != 0) {
      const CubicCurve curve = edge_curve(patch, k);
      const double s = foot_on_curve(curve, q);
      const Residual r = residual_of_curve(place_on_edge(k, s), point_on(curve, s) - q, facing);
      best = r.distance < best.distance ? r : best;
    }
  }
  return best;
}

}  // namespace

PatchFoot foot_on_patch(const CubicPatch& patch, const Vec3& q) {
  const auto& c = patch.control;
  const Vec3 u = c[1] - c[0], v = c[2] - c[0], w = q - c[0];
  const double uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), wu = w.dot(u), wv = w.dot(v);
  const double determinant = std::max(uu * vv - uv * uv, 1e-300);
  return foot_on_patch(patch, q, inside(Vec2((vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant)), 2);
}

PatchFoot foot_on_patch(const CubicPatch& patch, const Vec3& q, Vec2 start, int steps) {
  return foot_on_patch(PatchAxes(patch), q, start, steps);
}

PatchFoot foot_on_patch(const PatchAxes& patch, const Vec3& q, Vec2 start, int steps) {
  const Lanes wanted = lanes_of([&](std::size_t k) { return k < 3 ? q[static_cast<Eigen::Index>(k)] : 0.0; });
  Vec2 at = start;
  Lanes point = patch.point(at);
  Lanes r = wanted - point;
  double least = dot(r, r);
  for (int i = 0; i < steps; ++i) {
    const auto d = patch.tangents(at);
    double a = dot(d[0], d[0]), b = dot(d[0], d[1]), e = dot(d[1], d[1]);
    const double f = dot(d[0], r), g = dot(d[1], r);
    if (i >= gauss_newton_steps) {
      // What is left after these is the curvature's doing.
      const auto h = patch.second_derivatives(at);
      const double a2 = a - dot(h[0], r), b2 = b - dot(h[1], r), e2 = e - dot(h[2], r);
      if (a2 > 0 && a2 * e2 - b2 * b2 > 1e-3 * (a * e - b * b)) {
        a = a2;
        b = b2;
        e = e2;
      }
    }
    const double det = a * e - b * b;
    if (!(det > 1e-14 * a * e)) {
      break;
    }
    Vec2 next = at + Vec2((e * f - b * g) / det, (a * g - b * f) / det);
    if (next[0] < 0 || next[1] < 0 || next[0] + next[1] > 1) {
      // Along the border that is crossed the step is taken anew.
      next = inside(next);
      const Vec2 along = next[0] <= 0 ? Vec2(0, 1) : next[1] <= 0 ? Vec2(1, 0) : Vec2(-1, 1);
      const auto dn = patch.tangents(next);
      const Lanes tangent = along[0] * dn[0] + along[1] * dn[1];
      next =
          inside(next + along * (dot(tangent, wanted - patch.point(next)) / std::max(dot(tangent, tangent), 1e-300)));
    }
    const Lanes p = patch.point(next);
    const Lanes rest = wanted - p;
    const double squared = dot(rest, rest);
    if (squared >= least) {
      break;
    }
    const bool arrived = (next - at).squaredNorm() < arrival * arrival;
    at = next;
    point = p;
    r = rest;
    least = squared;
    if (arrived) {
      break;
    }
  }
  return {at, Vec3(point[0], point[1], point[2]), least};
}

std::array<Vec3, 3> edge_points(const CubicPatch& patch, std::size_t from, std::size_t to) {
  // The edge's curve alone: control points of a cubic.
  const auto& c = patch.control;
  const bool forward = to == (from + 1) % 3;
  const std::size_t edge = forward ? from : to;
  const Vec3 &a = c[from], &b = c[forward ? 3 + 2 * edge : 4 + 2 * edge], &d = c[forward ? 4 + 2 * edge : 3 + 2 * edge],
             &e = c[to];
  return {(27 * a + 27 * b + 9 * d + e) / 64, (a + 3 * b + 3 * d + e) / 8, (a + 9 * b + 27 * d + 27 * e) / 64};
}

void FitSamples::from_gap(const CubicPatch& patch, std::size_t from, std::size_t to, const std::array<Vec3, 3>& other,
                          std::vector<Residual>& out) {
  const Vec3 inward = patch.control[3 - from - to] - (patch.control[from] + patch.control[to]) / 2;
  const auto own = edge_points(patch, from, to);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2 at = on_edge(from, to, 0.25 * static_cast<double>(i + 1));
    const Vec3 apart = own[i] - other[i];
    const double width = apart.norm();
    if (width > 0 && apart.dot(inward) > 0) {  // else they overlap
      out.push_back({at, apart / width, width / 2});
    }
  }
}

FitSamples::FitSamples(const Target& target, std::size_t shells, bool boundaries)
    : target_(target),
      grid_of_target_(std::make_shared<StartGrid>(target.mesh())),
      boundaries_(boundaries && target.boundary_tree()) {
  const auto& mesh = target.mesh();
  std::vector<std::uint8_t> used(mesh.vertices.size(), 0);
  for (const auto& loop : target.boundary_vertices()) {
    const std::size_t stride =
        std::max<std::size_t>(1, loop.size() / (16 * static_cast<std::size_t>(std::sqrt(shells)) + 64));
    for (std::size_t i = 0; i < loop.size(); i += stride) {
      points_.push_back({mesh.vertices[loop[i]], boundaries_});
      used[loop[i]] = 1;
    }
    for (std::size_t i = 0; boundaries_ && i < loop.size(); ++i) {
      const Vec3 &here = mesh.vertices[loop[i]], &next = mesh.vertices[loop[(i + 1) % loop.size()]];
      further_boundary_.push_back(here);
      further_boundary_.emplace_back((here + next) / 2);
    }
  }
  const std::size_t wanted = points_per_shell * shells;
  if (mesh.vertices.size() > wanted) {
    // Every n-th triangle in the order of space: even over the surface.
    const auto& order = target.tree().spatial_order();
    const double stride = std::max(1.0, static_cast<double>(order.size()) / static_cast<double>(wanted));
    for (double i = stride / 2; i < static_cast<double>(order.size()); i += stride) {
      const Index v = mesh.triangles[order[static_cast<std::size_t>(i)]][0];
      if (used[v] == 0) {
        points_.push_back({mesh.vertices[v]});
        used[v] = 1;
      }
    }
  } else {
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      if (used[v] == 0) {
        points_.push_back({mesh.vertices[v]});
      }
    }
    if (mesh.triangles.size() + points_.size() <= wanted) {
      for (const auto& [a, b, c] : mesh.triangles) {
        points_.push_back({(mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3});
      }
    }
  }
  further_ = points_in_spatial_order(target);
  const int coarsest = mesh.triangles.size() < smooth_from * shells ? coarsest_on_facets : coarsest_grid;
  set_grid(std::clamp(
      static_cast<int>(std::sqrt(2.0 * static_cast<double>(most_grid_points) / static_cast<double>(shells + 1))) - 2,
      coarsest, finest_grid));
}

void FitSamples::set_grid(int level) {
  level_ = level;
  grid_.clear();
  grid_lanes_.clear();
  for (int i = 0; i <= level_; ++i) {
    for (int j = 0; i + j <= level_; ++j) {
      grid_.emplace_back(static_cast<double>(j) / level_, static_cast<double>(i) / level_);
    }
  }
  for (std::size_t i = 0; i < grid_.size(); i += lane_count) {
    const auto at = [&](Eigen::Index axis) {
      return lanes_of([&](std::size_t k) { return grid_[std::min(i + k, grid_.size() - 1)][axis]; });
    };
    grid_lanes_.push_back({at(0), at(1)});
  }
}

FitSamples FitSamples::of_piece(std::vector<SamplePoint> points, std::vector<Vec3> further,
                                std::vector<Vec3> further_boundary) const {
  FitSamples out = *this;
  out.points_ = std::move(points);
  out.further_ = std::move(further);
  out.further_boundary_ = std::move(further_boundary);
  if (level_ < level_of_pieces) {
    out.set_grid(level_of_pieces);
  }
  return out;
}

ClosestPoint::Hit FitSamples::downhill(const Vec3& p, Index start) const {
  const TriangleMesh& mesh = target_.mesh();
  const auto look = [&](Index t) {
    const auto& v = mesh.triangles[t];
    return foot_on_triangle(p, mesh.vertices[v[0]], mesh.vertices[v[1]], mesh.vertices[v[2]]);
  };
  Index here = start;
  TriangleFoot foot = look(here);
  if (foot.squared_distance > grid_of_target_->cell() * grid_of_target_->cell()) {
    // Far from where it was the last time.
    if (const auto other = grid_of_target_->near(p)) {
      if (const TriangleFoot there = look(*other); there.squared_distance < foot.squared_distance) {
        here = *other;
        foot = there;
      }
    }
  }
  for (int step = 0; step < most_steps; ++step) {
    if (foot.side == TriangleFoot::inside) {
      return {foot.point, here, foot.squared_distance};
    }
    Index next = no_neighbour;
    TriangleFoot best = foot;
    const auto consider = [&](Index other) {
      const TriangleFoot there = look(other);
      if (there.squared_distance < closer * best.squared_distance) {
        best = there;
        next = other;
      }
    };
    if (foot.side < 3) {
      if (const Index other = target_.across()[here][foot.side]; other != no_neighbour) {
        consider(other);
      }
    } else {
      for (const Index other : target_.around().of(mesh.triangles[here][foot.side - 3])) {
        consider(other);
      }
    }
    if (next == no_neighbour) {
      return {foot.point, here, foot.squared_distance};
    }
    here = next;
    foot = best;
  }
  return target_.tree().closest(p, here);
}

void FitSamples::downhill(const LaneVec3& p, std::size_t count, std::array<ClosestPoint::Hit, lane_count>& hits) const {
  const TriangleMesh& mesh = target_.mesh();
  const auto corner = [&](std::size_t c) {
    return lane_points(
        [&](std::size_t k) -> const Vec3& { return mesh.vertices[mesh.triangles[hits[k].triangle][c]]; });
  };
  const LaneVec3 a = corner(0), ab = corner(1) - a, ac = corner(2) - a, ap = p - a;
  const Lanes uu = ab.dot(ab), uv = ab.dot(ac), vv = ac.dot(ac), pu = ap.dot(ab), pv = ap.dot(ac);
  const Lanes determinant = uu * vv - uv * uv;
  const Lanes s = vv * pu - uv * pv, t = uu * pv - uv * pu;
  const LaneMask within = s > 0.0 && t > 0.0 && s + t < determinant;
  const Lanes inverse = 1.0 / determinant;
  const LaneVec3 foot = a + (s * inverse) * ab + (t * inverse) * ac;
  const LaneVec3 away = p - foot;
  const Lanes squared = away.dot(away);
  for (std::size_t k = 0; k < count; ++k) {
    if (within[k]) {
      hits[k].point = Vec3(foot[0][k], foot[1][k], foot[2][k]);
      hits[k].squared_distance = squared[k];
    } else {
      hits[k] = downhill(Vec3(p[0][k], p[1][k], p[2][k]), hits[k].triangle);
    }
  }
}

void FitSamples::from_patch(const PatchPowers& patch, const Vec3& facing, double doubted, std::vector<Index>& guesses,
                            std::vector<Residual>& out) const {
  if (guesses.size() != grid_.size()) {
    guesses.assign(grid_.size(), guesses.empty() ? no_neighbour : guesses[0]);
  }
  Index last = guesses[0];
  std::array<ClosestPoint::Hit, lane_count> hits;
  for (std::size_t i = 0; i < grid_.size(); i += lane_count) {
    const auto& [x, y] = grid_lanes_[i / lane_count];
    const LaneVec3 points = patch.point(x, y);
    const std::size_t count = std::min(lane_count, grid_.size() - i);
    const auto point = [&](std::size_t k) { return Vec3(points[0][k], points[1][k], points[2][k]); };
    bool all_known = true;
    for (std::size_t k = 0; k < lane_count; ++k) {
      const Index guess = guesses[std::min(i + k, grid_.size() - 1)];
      hits[k].triangle = guess == no_neighbour ? last : guess;
      all_known = all_known && hits[k].triangle != no_neighbour;
    }
    if (all_known) {
      downhill(points, count, hits);
      for (std::size_t k = 0; k < count; ++k) {
        if (hits[k].squared_distance > doubted * doubted) {
          hits[k] = target_.tree().closest(point(k), hits[k].triangle);
        }
      }
    } else {
      for (std::size_t k = 0; k < count; ++k) {
        hits[k] = last == no_neighbour ? target_.tree().closest(point(k)) : target_.tree().closest(point(k), last);
        last = hits[k].triangle;
      }
    }
    last = hits[count - 1].triangle;
    for (std::size_t k = 0; k < count; ++k) {
      guesses[i + k] = hits[k].triangle;
      out.push_back(residual_of(grid_[i + k], point(k), hits[k], facing));
    }
  }
}

void FitSamples::from_places(const CubicPatch& patch, const Vec3& facing, const std::vector<Vec2>& places,
                             std::vector<Residual>& out) const {
  for (const Vec2& at : places) {
    const Vec3 p = patch.point(at);
    out.push_back(residual_of(at, p, target_.tree().closest(p), facing));
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
  const Vec3 away = p - hit.point;
  const double distance = away.norm();
  return {at, distance > 0 ? Vec3(away / distance) : facing, distance};
}

void FitSamples::from_target(const CubicPatch& patch, const PatchPowers& powers, const Vec3& facing, EdgeBits boundary,
                             const std::vector<Index>& points, std::vector<Residual>& out) const {
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
      out.push_back(residual({feet.x[k], feet.y[k]}, lane(away), normal.squaredNorm() > 0.5 ? normal : facing));
    }
    count = 0;
  };
  for (const Index point : points) {
    if (points_[point].of_boundary && boundary != 0) {
      out.push_back(residual_on_edges(patch, facing, boundary, points_[point].point));
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

void FitSamples::from_boundary(const CubicPatch& patch, const Vec3& facing, EdgeBits boundary,
                               std::vector<Residual>& out) const {
  for (std::size_t k = 0; k < 3 && boundaries_; ++k) {
    if ((boundary >> k & 1) == 0) {
      continue;
    }
    const CubicCurve curve = edge_curve(patch, k);
    for (int i = 0; i <= points_per_edge; ++i) {
      const double s = static_cast<double>(i) / points_per_edge;
      const Vec3 p = point_on(curve, s);
      out.push_back(residual_of_curve(place_on_edge(k, s), p - target_.boundary_tree()->closest(p).point, facing));
    }
  }
}

Target::Foot FitSamples::foot(const Vec3& p, const Vec3& facing) const {
  const auto foot = target_.closest_facing(p, facing, target_.diagonal());
  return foot ? *foot : target_.closest(p);
}

}  // namespace tunica
