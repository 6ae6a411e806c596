#include "shell/fit_shape.hpp"

#include "shell/fit_edit.hpp"
#include "surface/closest_point.hpp"
#include "surface/measure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

constexpr int passes = 4;
constexpr double good_angle = 28;   // degrees: better ones are not looked for
constexpr double worth_it = 0.3;    // degrees
constexpr double first_step = 0.4;  // of the mean edge
constexpr int halvings = 4;
constexpr int directions = 8;
constexpr int most_tries = 16;

double angle_of(const FitState& state, Index t) {
  const auto c = state.mesh.corners(t);
  return smallest_angle_degrees(c[0], c[1], c[2]);
}

/// Thinnest first.
std::vector<Index> thin_triangles(const FitState& state) {
  std::vector<std::pair<double, Index>> found;
  for (Index t = 0; t < state.mesh.triangles.size(); ++t) {
    if (state.mesh.is_alive(t) && angle_of(state, t) < state.limits.angle) {
      found.emplace_back(angle_of(state, t), t);
    }
  }
  std::sort(found.begin(), found.end());
  std::vector<Index> out;
  for (const auto& [angle, t] : found) {
    out.push_back(t);
  }
  return out;
}

/// Smallest angle around a node, were it at p; none where a facet would turn over.
double angle_around(const FitState& state, Index v, const Vec3& p) {
  double least = std::max(good_angle, state.limits.angle);
  for (const Index t : state.mesh.around[v]) {
    auto c = state.mesh.corners(t);
    const Vec3 before = facing_of(c);
    c[state.mesh.corner_of(t, v)] = p;
    if (facing_of(c).dot(before) < 0.5) {
      return 0;
    }
    least = std::min(least, smallest_angle_degrees(c[0], c[1], c[2]));
  }
  return least;
}

Vec3 on_boundary(const Target& target, const Vec3& p) {
  Vec3 best = p;
  double least = std::numeric_limits<double>::infinity();
  for (const auto& loop : target.boundary()) {
    for (std::size_t i = 0; i < loop.size(); ++i) {
      const Vec3 &a = loop[i], &b = loop[(i + 1) % loop.size()];
      const double along = std::clamp((p - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
      const Vec3 q = a + along * (b - a);
      if ((p - q).squaredNorm() < least) {
        least = (p - q).squaredNorm();
        best = q;
      }
    }
  }
  return best;
}

/// Slides a node to where the angles around it are best.
bool slide(FitState& state, Index v, double limit) {
  const FitMesh& mesh = state.mesh;
  if (mesh.is_held(v)) {
    return false;
  }
  Vec3 normal = Vec3::Zero();
  double edge = 0, error = limit;
  for (const Index t : mesh.around[v]) {
    normal += facing_of(mesh.corners(t));
    const std::size_t k = mesh.corner_of(t, v);
    edge += (mesh.positions[mesh.triangles[t][(k + 1) % 3]] - mesh.positions[v]).norm();
    error = std::max(error, 1.0001 * state.patches[t].error);
  }
  edge /= static_cast<double>(mesh.around[v].size());
  if (!(normal.norm() > 1e-6)) {
    return false;
  }
  normal.normalize();
  const auto axes = tilt_axes(normal);
  // Along the edges too: on a crease or rim no other way keeps the fit.
  std::vector<Vec3> ways;
  for (int d = 0; d < directions; ++d) {
    const double a = 2 * 3.14159265358979323846 * d / directions;
    ways.emplace_back(std::cos(a) * axes[0] + std::sin(a) * axes[1]);
  }
  std::vector<Index> ring;
  mesh.ring(v, ring);
  for (const Index w : ring) {
    const Vec3 way = (mesh.positions[w] - mesh.positions[v]).normalized();
    ways.push_back(way);
    ways.push_back(-way);
  }
  const double before = angle_around(state, v, mesh.positions[v]);
  Vec3 best = mesh.positions[v];
  double angle = before;
  double step = first_step * edge;
  for (int halving = 0; halving <= halvings; ++halving, step /= 2) {
    const Vec3 from = best;
    for (const Vec3& way : ways) {
      Vec3 p = from + step * way;
      if (mesh.on_boundary[v] != 0) {
        p = on_boundary(state.samples().target(), p);
      }
      if (const double there = angle_around(state, v, p); there > angle) {
        angle = there;
        best = p;
      }
    }
  }
  if (angle < before + worth_it) {
    return false;
  }
  if (mesh.on_boundary[v] == 0) {
    best = state.samples().foot(best, normal).point;
  }
  // Less of the way where the whole spoils the fit.
  const Vec3 start = mesh.positions[v];
  for (const double part : {1.0, 0.5, 0.25}) {
    const Vec3 p = start + part * (best - start);
    const double there = std::min(angle_around(state, v, p), state.limits.angle);
    if (there > before + worth_it * part && move_node(state, v, p, 0.99 * there, error)) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::size_t count_thin(const FitState& state) { return thin_triangles(state).size(); }

std::size_t mend_angles(FitState& state, double limit) {
  std::size_t left = count_thin(state);
  for (int pass = 0; pass < passes && left > 0; ++pass) {
    const std::size_t flips = flip_edges(state, limit);
    std::size_t moves = 0;
    for (const Index t : thin_triangles(state)) {
      for (const Index v : state.mesh.triangles[t]) {
        moves += slide(state, v, limit) ? 1 : 0;
      }
    }
    left = count_thin(state);
    if (flips + moves == 0) {
      break;
    }
  }
  return left;
}

namespace {

/// The edges of a triangle, shortest first.
std::array<std::array<Index, 2>, 3> edges_of(const FitMesh& mesh, Index t) {
  const auto v = mesh.triangles[t];
  std::array<std::array<Index, 2>, 3> edges{{{v[0], v[1]}, {v[1], v[2]}, {v[2], v[0]}}};
  const auto length = [&](const std::array<Index, 2>& e) {
    return (mesh.positions[e[1]] - mesh.positions[e[0]]).norm();
  };
  std::stable_sort(edges.begin(), edges.end(), [&](const auto& a, const auto& b) { return length(a) < length(b); });
  return edges;
}

}  // namespace

void rid_of_thin(FitState& state, double limit, std::size_t most, std::size_t patience) {
  std::size_t left = mend_angles(state, limit), fruitless = 0;
  for (int i = 0; i < most_tries && left > 0 && left <= 3 * patience; ++i) {
    const auto thin = thin_triangles(state);
    if (fruitless >= std::min(patience, thin.size())) {
      return;
    }
    const auto edges = edges_of(state.mesh, thin[fruitless]);
    bool better = false;
    for (const bool merging : {true, false}) {
      FitState trial = state;
      const auto [u, v] = merging ? edges[0] : edges[2];
      if (merging ? !merge_edge(trial, u, v, limit) : state.mesh.alive + 2 > most || !split_edge(trial, u, v, limit)) {
        continue;
      }
      const std::size_t now = mend_angles(trial, limit);
      if (now < left && trial.error() <= limit) {
        state = std::move(trial);
        left = now;
        better = true;
        break;
      }
    }
    fruitless = better ? 0 : fruitless + 1;
  }
}

}  // namespace tunica
