#include "tunica/mechanics/runs/meeting_walls.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/mechanics/elements/rotation.hpp"
#include "tunica/mechanics/runs/detail/places.hpp"
#include "tunica/shell/distance/shell_crossings.hpp"
#include "tunica/surface/distance/closest_point.hpp"
#include "tunica/surface/mesh/self_intersections.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

namespace tunica {
namespace {

/// The surfaces of all bodies as one mesh, with the model's nodes, displaced by a state; where there is none, as they
/// are.
/// @return empty corner normals where some shell has none
ShellMesh joined_surfaces(const Model& model, const std::vector<SurfaceFace>& faces, const State* state) {
  ShellMesh all;
  const bool curved =
      !model.shells.empty() && std::ranges::all_of(model.shells, [](const ShellBody& body) { return body.curved; });
  for (std::size_t b = 0; b < model.body_count(); ++b) {
    const std::vector<Vec3>& vertices = model.vertices_of(b);
    all.vertices.insert(all.vertices.end(), vertices.begin(), vertices.end());
  }
  for (std::size_t i = 0; state != nullptr && i < all.vertices.size(); ++i) {
    all.vertices[i] += state->displacement[i];
  }
  for (const SurfaceFace& face : faces) {
    all.triangles.push_back(face.nodes);
    if (!curved) {
      continue;
    }
    std::array<Vec3, 3> normals = face.normals;
    if (!face.curved) {
      const auto& [a, b, c] = face.nodes;
      normals.fill((all.vertices[b] - all.vertices[a]).cross(all.vertices[c] - all.vertices[a]).normalized());
    } else if (state != nullptr) {
      for (std::size_t k = 0; k < 3; ++k) {
        normals[k] = exponential(state->rotation[face.nodes[k]]) * normals[k];
      }
    }
    all.corner_normals.push_back(normals);
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

double distance_of(const Vec3& p, const Corners& triangle) {
  return (closest_point_on_triangle(p, triangle[0], triangle[1], triangle[2]) - p).norm();
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

/// @param tied  of two faces, by their numbers
/// @param reference  where walls that overlap were farther apart: at a crease they are near from the beginning
template <typename AreTied>
Meetings meetings(const std::vector<SurfaceFace>& faces, const std::vector<std::array<Index, 3>>& triangles,
                  const std::vector<Vec3>& reference, const std::vector<Vec3>& from, const std::vector<Vec3>& to,
                  const AreTied& tied) {
  constexpr double overlap = 0.5, nearer_by = 0.25;  // of the wall
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
        const Vec3 reach = Vec3::Constant(overlap * faces[t].half_thickness);
        lower[t] = lower[t].cwiseMin(before[node].cwiseMin(after[node]) - reach);
        upper[t] = upper[t].cwiseMax(before[node].cwiseMax(after[node]) + reach);
      }
    }
    const auto look = [&](std::size_t of, std::size_t beside) {
      const auto& other = triangles[beside];
      const Corners now = corners_of(other, after);
      const Corners then = corners_of(other, before);
      const double wall = faces[of].half_thickness + faces[beside].half_thickness;
      for (const Index node : triangles[of]) {
        const Foot foot = foot_on(now, after[node]);
        if (part == ways.parts() && foot.is_inside && std::abs(foot.height) < overlap * wall &&
            distance_of(reference[node], corners_of(other, reference)) > std::abs(foot.height) + nearer_by * wall) {
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
      if (!share && !tied(i, j)) {
        look(i, j);
        look(j, i);
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
  const std::vector<SurfaceFace> faces = surface_faces(model).faces;
  const ShellMesh all = joined_surfaces(model, faces, nullptr);
  std::map<std::array<std::size_t, 2>, std::pair<std::size_t, Vec3>> pairs;  // of bodies: how many faces, and where
  for (const auto& [one, other] : crossings_of(all)) {
    const auto [a, b] = std::minmax({faces[one].body, faces[other].body});
    if (!are_tied(model, a, b)) {
      ++pairs.try_emplace({a, b}, 0, all.vertices[all.triangles[one][0]]).first->second.first;
    }
  }
  for (const auto& [bodies, what] : pairs) {
    if (bodies[0] == bodies[1]) {
      found.push_back(
          {Weight::major, "surface crosses itself",
           fmt::format(
               "{}: passes through itself in {} pairs of faces, the first at {}: the numbers of the wall around "
               "there mean nothing: mend or smooth the surface (SMOOTH), or take a finer mesh",
               label_of(model, bodies[0]), what.first, where(what.second))});
      continue;
    }
    found.push_back(
        {Weight::major, "walls through each other",
         fmt::format("{} and {} pass through each other in {} pairs of faces, the first at {}, and nothing "
                     "holds them apart: move them apart and add a [[contact]] between them",
                     label_of(model, bodies[0]), model.name_of(bodies[1]), what.first, where(what.second))});
  }
  return found;
}

CrossingWatch::CrossingWatch(const Model& model) : model_(model) {
  require_valid(model);
  faces_ = surface_faces(model).faces;
  reference_ = last_ = joined_surfaces(model, faces_, nullptr).vertices;
}

void CrossingWatch::see(const State& state) {
  require_valid(model_, state);
  if (found_) {
    return;
  }
  const ShellMesh now = joined_surfaces(model_, faces_, &state);
  const std::vector<Vec3> last = std::exchange(last_, now.vertices);
  const auto tell = [&](const char* kind, std::size_t body, const std::string& what, const Vec3& place) {
    const std::string when = state.velocity.empty() ? fmt::format("at load factor {:.3g}", state.load_factor)
                                                    : fmt::format("at {:.3g} s", state.time);
    found_ = {Weight::major, kind,
              fmt::format("{}: {} {}, the first at {}: the numbers from there on mean nothing: add a [[contact]] "
                          "between what meets, the same body twice where it is itself, or lower the load",
                          label_of(model_, body), when, what, where(place))};
  };
  // What is tied meets in a seam, where the chords of the one go through the other.
  const auto tied = [&](std::size_t a, std::size_t b) {
    return faces_[a].body != faces_[b].body && are_tied(model_, faces_[a].body, faces_[b].body);
  };
  std::vector<std::array<Index, 2>> crossings = crossings_of(now);
  std::erase_if(crossings, [&](const auto& pair) { return tied(pair[0], pair[1]); });
  if (!crossings.empty()) {
    if (!before_) {
      before_ = crossings_of(joined_surfaces(model_, faces_, nullptr));
    }
    std::vector<std::array<Index, 2>> made;
    std::ranges::set_difference(crossings, *before_, std::back_inserter(made));
    if (!made.empty()) {
      const Corners corners = corners_of(now.triangles[made.front()[0]], now.vertices);
      tell("walls through each other", faces_[made.front()[0]].body,
           fmt::format("the wall passes through itself or another in {} pairs of faces{}", made.size(),
                       before_->empty() ? "" : " more than without load"),
           (corners[0] + corners[1] + corners[2]) / 3);
      return;
    }
  }
  const auto body_of = [&](Index node) {
    std::size_t body = 0;
    while (node >= model_.first_node(body + 1)) {
      ++body;
    }
    return body;
  };
  const Meetings met = meetings(faces_, now.triangles, reference_, last, now.vertices, tied);
  if (!met.passed.empty()) {
    tell("walls through each other", body_of(met.passed.front()),
         fmt::format("the wall has passed through itself or another at {} nodes since the state before",
                     met.passed.size()),
         now.vertices[met.passed.front()]);
  } else if (!met.overlapping.empty()) {
    tell("walls overlap", body_of(met.overlapping.front()),
         fmt::format("the wall overlaps with itself or another by more than half of it at {} nodes",
                     met.overlapping.size()),
         now.vertices[met.overlapping.front()]);
  }
}

}  // namespace tunica
