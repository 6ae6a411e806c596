#include "tunica/mechanics/runs/meeting_walls.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

namespace tunica {
namespace {

/// All shells as one mesh, displaced by a state; where there is none, as they are.
/// @return empty corner normals where some body has none
ShellMesh joined_shells(const Model& model, const State* state) {
  ShellMesh all;
  const bool curved = std::ranges::all_of(model.shells, [](const ShellBody& body) { return body.curved; });
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    const ShellMesh& mesh = model.shells[b].mesh;
    const std::size_t first = model.first_node(b);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
      all.vertices.push_back(mesh.vertices[i] +
                             (state == nullptr ? Vec3(Vec3::Zero()) : state->displacement[first + i]));
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      std::array<Index, 3> corners{};
      std::array<Vec3, 3> normals;
      for (std::size_t k = 0; k < 3; ++k) {
        const Index node = mesh.triangles[t][k];
        corners[k] = narrow<Index>(first + node);
        normals[k] = curved ? mesh.normal(t, k) : Vec3(Vec3::Zero());
        if (curved && state != nullptr) {
          normals[k] = exponential(state->rotation[first + node]) * normals[k];
        }
      }
      all.triangles.push_back(corners);
      if (curved) {
        all.corner_normals.push_back(normals);
      }
    }
  }
  return all;
}

/// But those of neighbours: that these fold over each other is an element's failure, which the run itself tells.
std::vector<std::array<Index, 2>> crossings_of(const ShellMesh& shells) {
  if (!shells.corner_normals.empty()) {
    try {
      return crossing_patches(shells, false);
    } catch (const InputError&) {  // folded over: there is no patch
    }
  }
  std::vector<std::array<Index, 2>> crossings = find_self_intersections(flat_facets(shells));
  std::erase_if(crossings, [&](const auto& pair) { return share_a_node(shells, pair); });
  return crossings;
}

/// Of each node of the shells.
std::vector<std::size_t> bodies_of(const Model& model) {
  std::vector<std::size_t> bodies;
  for (std::size_t b = 0; b < model.shells.size(); ++b) {
    bodies.insert(bodies.end(), model.shells[b].mesh.vertices.size(), b);
  }
  return bodies;
}

bool are_tied(const Model& model, std::size_t a, std::size_t b) {
  return std::ranges::any_of(model.attachments, [&](const Attachment& tie) {
    return (tie.body == a && tie.to == b) || (tie.body == b && tie.to == a);
  });
}

using Corners = std::array<Vec3, 3>;

Corners corners_of(const std::array<Index, 3>& triangle, const std::vector<Vec3>& x) {
  return {x[triangle[0]], x[triangle[1]], x[triangle[2]]};
}

/// Where a point lies as seen from a triangle.
struct Foot {
  double height = 0;       ///< mm, along the normal
  bool is_inside = false;  ///< the foot of the perpendicular
};

Foot foot_on(const Corners& triangle, const Vec3& p) {
  const Vec3 u = triangle[1] - triangle[0];
  const Vec3 v = triangle[2] - triangle[0];
  const Vec3 normal = u.cross(v);
  const double squared = normal.squaredNorm();
  if (!(squared > 0)) {
    return {};
  }
  const Vec3 arm = p - triangle[0];
  const double first = arm.cross(v).dot(normal) / squared;
  const double second = u.cross(arm).dot(normal) / squared;
  return {arm.dot(normal) / std::sqrt(squared), first >= 0 && second >= 0 && first + second <= 1};
}

/// The nodes that overlap with a wall in the end, and those that have passed through one on their straight ways.
struct Meetings {
  std::vector<Index> overlapping, passed;  ///< in ascending order
};

/// What moves in one piece has its mean motion taken off, and goes in parts about as long as a shell's edge.
class Ways {
public:
  Ways(const std::vector<Vec3>& from, const std::vector<Vec3>& to, const std::vector<std::array<Index, 3>>& triangles)
      : from_(from), to_(to) {
    constexpr double most_parts = 64;
    Vec3 mean = Vec3::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
      mean += (to[i] - from[i]) / real(from.size());
    }
    double farthest = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      to_[i] -= mean;
      farthest = std::max(farthest, (to_[i] - from[i]).norm());
    }
    double edge = 0;
    for (const auto& [a, b, c] : triangles) {
      edge += (from[a] - from[b]).norm() / real(triangles.size());
    }
    parts_ = truncated<std::size_t>(std::clamp(std::ceil(farthest / edge), 1.0, most_parts));
  }
  [[nodiscard]] std::size_t parts() const { return parts_; }
  [[nodiscard]] std::vector<Vec3> after(std::size_t part) const {
    std::vector<Vec3> x(from_.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = from_[i] + real(part) / real(parts_) * (to_[i] - from_[i]);
    }
    return x;
  }

private:
  const std::vector<Vec3>& from_;
  std::vector<Vec3> to_;
  std::size_t parts_ = 1;
};

/// Whether a point has gone through a triangle, both going straight.
bool goes_through(const Corners& from, const Corners& to, const Vec3& p_from, const Vec3& p_to) {
  const double before = foot_on(from, p_from).height;
  const double after = foot_on(to, p_to).height;
  if (!(before * after < 0)) {
    return false;
  }
  const double part = before / (before - after);
  const auto between = [&](const Vec3& a, const Vec3& b) -> Vec3 { return a + part * (b - a); };
  return foot_on({between(from[0], to[0]), between(from[1], to[1]), between(from[2], to[2])}, between(p_from, p_to))
      .is_inside;
}

/// Whether a point lies on different sides of a triangle before and after, clear of the wall and of what the triangle
/// leaves out of a curved shell.
bool has_changed_sides(const Corners& from, const Corners& to, const Vec3& p_from, const Vec3& p_to, double wall) {
  constexpr double of_edge = 0.1;  // the sagitta of an arc of 45 degrees
  const double before = foot_on(from, p_from).height;
  const double after = foot_on(to, p_to).height;
  const double clear = std::max(wall, of_edge * (to[1] - to[0]).norm());
  return before * after < 0 && std::min(std::abs(before), std::abs(after)) > clear;
}

/// @param half_wall  mm, of each node
template <typename AreTied>
Meetings meetings(const std::vector<std::array<Index, 3>>& triangles, const std::vector<double>& half_wall,
                  const std::vector<Vec3>& from, const std::vector<Vec3>& to, const AreTied& tied) {
  constexpr double overlap = 0.5;  // of the wall
  const Ways ways(from, to, triangles);
  Meetings found;
  std::vector<Vec3> before = from;
  std::vector<Vec3> lower(triangles.size()), upper(triangles.size());
  for (std::size_t part = 1; part <= ways.parts(); ++part) {
    const std::vector<Vec3> after = ways.after(part);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      lower[t].setConstant(infinity);
      upper[t].setConstant(-infinity);
      for (const Index node : triangles[t]) {
        const Vec3 reach = Vec3::Constant(overlap * half_wall[node]);
        lower[t] = lower[t].cwiseMin(before[node].cwiseMin(after[node]) - reach);
        upper[t] = upper[t].cwiseMax(before[node].cwiseMax(after[node]) + reach);
      }
    }
    const auto look = [&](const std::array<Index, 3>& one, const std::array<Index, 3>& other) {
      const Corners now = corners_of(other, after);
      const Corners then = corners_of(other, before);
      for (const Index node : one) {
        const double wall = half_wall[node] + half_wall[other[0]];
        const Foot foot = foot_on(now, after[node]);
        if (part == ways.parts() && foot.is_inside && std::abs(foot.height) < overlap * wall) {
          found.overlapping.push_back(node);
        }
        if (goes_through(then, now, before[node], after[node]) &&
            has_changed_sides(corners_of(other, from), corners_of(other, to), from[node], to[node], wall)) {
          found.passed.push_back(node);
        }
      }
    };
    for (const auto& [i, j] : overlapping_boxes(lower, upper)) {
      const auto& [one, other] = std::tie(triangles[i], triangles[j]);
      const bool share = std::ranges::find_first_of(one, other) != one.end();
      if (!share && !tied(one[0], other[0])) {
        look(one, other);
        look(other, one);
      }
    }
    before = after;
  }
  for (std::vector<Index>* nodes : {&found.overlapping, &found.passed}) {
    std::ranges::sort(*nodes);
    nodes->erase(std::ranges::unique(*nodes).begin(), nodes->end());
  }
  return found;
}

}  // namespace

std::vector<Warning> doubts_of_meeting_walls(const Model& model) {
  require_valid(model);
  std::vector<Warning> found;
  const ShellMesh all = joined_shells(model, nullptr);
  const std::vector<std::size_t> bodies_of_nodes = bodies_of(model);
  const auto body_of = [&](Index triangle) { return bodies_of_nodes[all.triangles[triangle][0]]; };
  std::map<std::array<std::size_t, 2>, std::pair<std::size_t, Vec3>> pairs;  // of bodies: how many shells, and where
  for (const auto& [one, other] : crossings_of(all)) {
    const auto [a, b] = std::minmax({body_of(one), body_of(other)});
    if (!are_tied(model, a, b)) {
      ++pairs.try_emplace({a, b}, 0, all.vertices[all.triangles[one][0]]).first->second.first;
    }
  }
  for (const auto& [bodies, what] : pairs) {
    if (bodies[0] == bodies[1]) {
      found.push_back(
          {Weight::major, "surface crosses itself",
           fmt::format(
               "{}: passes through itself in {} pairs of shells, the first at {}: the numbers of the wall around "
               "there mean nothing: mend the surface, or take more shells",
               named(model.shells[bodies[0]].said_at, model.shells[bodies[0]].name), what.first, where(what.second))});
      continue;
    }
    found.push_back(
        {Weight::major, "walls through each other",
         fmt::format("{} and {} pass through each other in {} pairs of shells, the first at {}, and nothing "
                     "holds them apart: move them apart and add a [[contact]] between them",
                     named(model.shells[bodies[0]].said_at, model.shells[bodies[0]].name), model.shells[bodies[1]].name,
                     what.first, where(what.second))});
  }
  return found;
}

CrossingWatch::CrossingWatch(const Model& model) : model_(model), body_(bodies_of(model)) {
  require_valid(model);
  for (const ShellBody& body : model.shells) {
    for (std::size_t i = 0; i < body.mesh.vertices.size(); ++i) {
      half_wall_.push_back(body.thickness[body.thickness.size() == 1 ? 0 : i] / 2);
      last_.push_back(body.mesh.vertices[i]);
    }
  }
}

void CrossingWatch::see(const State& state) {
  require_valid(model_, state);
  if (found_ || model_.shells.empty()) {
    return;
  }
  const ShellMesh now = joined_shells(model_, &state);
  const std::vector<Vec3> last = std::exchange(last_, now.vertices);
  const auto tell = [&](const char* kind, const std::string& what, const Vec3& place) {
    const std::string when = state.velocity.empty() ? fmt::format("at load factor {:.3g}", state.load_factor)
                                                    : fmt::format("at {:.3g} s", state.time);
    found_ = {Weight::major, kind,
              fmt::format("{}: {} {}, the first at {}: the numbers from there on mean nothing: add a [[contact]] "
                          "between what meets, the same body twice where it is itself, or lower the load",
                          named(model_.shells.front().said_at, model_.shells.front().name), when, what, where(place))};
  };
  // What is tied meets in a seam, where the chords of the one go through the other.
  const auto tied = [&](Index a, Index b) { return body_[a] != body_[b] && are_tied(model_, body_[a], body_[b]); };
  std::vector<std::array<Index, 2>> crossings = crossings_of(now);
  std::erase_if(crossings,
                [&](const auto& pair) { return tied(now.triangles[pair[0]][0], now.triangles[pair[1]][0]); });
  if (!crossings.empty()) {
    if (!before_) {
      before_ = crossings_of(joined_shells(model_, nullptr));
    }
    std::vector<std::array<Index, 2>> made;
    std::ranges::set_difference(crossings, *before_, std::back_inserter(made));
    if (!made.empty()) {
      const Corners corners = corners_of(now.triangles[made.front()[0]], now.vertices);
      tell("walls through each other",
           fmt::format("the wall passes through itself or another in {} pairs of shells{}", made.size(),
                       before_->empty() ? "" : " more than without load"),
           (corners[0] + corners[1] + corners[2]) / 3);
      return;
    }
  }
  Meetings met = meetings(now.triangles, half_wall_, last, now.vertices, tied);
  if (!met.passed.empty()) {
    tell("walls through each other",
         fmt::format("the wall has passed through itself or another at {} nodes since the state before",
                     met.passed.size()),
         now.vertices[met.passed.front()]);
    return;
  }
  if (!met.overlapping.empty()) {
    const std::vector<Vec3> reference = joined_shells(model_, nullptr).vertices;
    std::vector<Index> made;
    std::ranges::set_difference(met.overlapping,
                                meetings(now.triangles, half_wall_, reference, reference, tied).overlapping,
                                std::back_inserter(made));
    if (!made.empty()) {
      tell("walls overlap",
           fmt::format("the wall overlaps with itself or another by more than half of it at {} nodes", made.size()),
           now.vertices[made.front()]);
    }
  }
}

}  // namespace tunica
