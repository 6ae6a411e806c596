#include "tunica/mechanics/contact/detail/contact_parts.hpp"

#include <algorithm>
#include <functional>

namespace tunica {
namespace {

double bend_of(const SurfaceFace& face, const PatchMap& map, int level) {
  return face.curved ? flatness(patch_of(face, map), level) : 0.0;
}

std::array<Vec3, 3> corners_of(const SurfaceFace& face, const PatchMap& map, const Part& part) {
  std::array<Vec3, 3> corners;
  for (int k = 0; k < 3; ++k) {
    corners[k] = map.point(patch_weights(face, part.at[k]));
  }
  return corners;
}

/// From q to p, between their facets' nearest points as seen from the corners.
Vec3 shortest_way(const std::array<Vec3, 3>& p, const std::array<Vec3, 3>& q) {
  Vec3 shortest = Vec3::Constant(infinity);
  const auto look = [&](const Vec3& way) { shortest = way.squaredNorm() < shortest.squaredNorm() ? way : shortest; };
  for (int k = 0; k < 3; ++k) {
    look(p[k] - closest_point_on_triangle(p[k], q[0], q[1], q[2]));
    look(closest_point_on_triangle(q[k], p[0], p[1], p[2]) - q[k]);
  }
  return shortest.normalized();
}

/// The directions that can tell two triangles apart, and the shortest way between them first.
/// Source: the separating axes of convex bodies: normals, and what is normal to an edge of each.
std::array<Vec3, 12> separating_directions(const std::array<Vec3, 3>& p, const std::array<Vec3, 3>& q) {
  const auto edge = [](const std::array<Vec3, 3>& of, std::size_t k) { return Vec3(of[(k + 1) % 3] - of[k]); };
  std::array<Vec3, 12> directions;
  directions[0] = shortest_way(p, q);
  directions[1] = edge(p, 0).cross(edge(p, 1)).normalized();
  directions[2] = edge(q, 0).cross(edge(q, 1)).normalized();
  for (std::size_t k = 0; k < 9; ++k) {
    directions[3 + k] = edge(p, k / 3).cross(edge(q, k % 3)).normalized();  // zero of parallel edges: tells nothing
  }
  return directions;
}

/// A lower bound of the distance of two triangles, mm.
double distance_bound(const std::array<Vec3, 3>& p, const std::array<Vec3, 3>& q) {
  double bound = 0;
  for (const Vec3& n : separating_directions(p, q)) {
    const std::array<double, 3> own{n.dot(p[0]), n.dot(p[1]), n.dot(p[2])};
    const std::array<double, 3> theirs{n.dot(q[0]), n.dot(q[1]), n.dot(q[2])};
    bound =
        std::max({bound, *std::min_element(own.begin(), own.end()) - *std::max_element(theirs.begin(), theirs.end()),
                  *std::min_element(theirs.begin(), theirs.end()) - *std::max_element(own.begin(), own.end())});
  }
  return bound;
}

/// A lower bound of the distance of a part of a face from a rigid body, mm.
/// @param part  and its level; triangles  of a mesh that may be near; wanted  less than the first must be exact, more
/// than the second is of no interest
double bound_to_rigid(const RigidShape& shape, const SurfaceFace& face, const PatchMap& map,
                      const std::pair<Part, int>& part, const std::vector<std::array<Vec3, 3>>& triangles,
                      const std::array<double, 2>& wanted) {
  const Vec3 c = map.point(patch_weights(face, middle(part.first)));
  const RigidDistance at = shape.at(c);
  const double bend = bend_of(face, map, part.second);
  if (shape.convex()) {  // the tangent of a convex function lies below it
    return at.distance + extent(face, map, part.first, at.normal)[0] - at.normal.dot(c) - bend;
  }
  const auto corners = corners_of(face, map, part.first);
  double reach = 0;
  for (const Vec3& corner : corners) {
    reach = std::max(reach, (corner - c).norm());
  }
  double bound = at.distance - reach - bend;
  if (at.distance > 0 && bound < wanted[0]) {  // outside: by the triangles themselves
    bound = wanted[1];
    for (const auto& triangle : triangles) {
      bound = std::min(bound, distance_bound(corners, triangle) - bend);
    }
  }
  return bound;
}

/// Whether two faces certainly stay apart on straight lines: some plane has them on either side at both ends.
bool stay_apart(const SurfaceFace& face, const PatchMap& a0, const PatchMap& a1, const SurfaceFace& other,
                const PatchMap& b0, const PatchMap& b1, double slack) {
  const std::function<bool(const Part&, const Part&, int, int)> certain = [&](const Part& p, const Part& q, int level,
                                                                              int depth) {
    const double bend0 = bend_of(face, a0, level) + bend_of(other, b0, level);
    const double bend1 = bend_of(face, a1, level) + bend_of(other, b1, level);
    const auto told_by = [&](const Vec3& n) {
      return extent(face, a0, p, n)[0] - extent(other, b0, q, n)[1] > bend0 - slack &&
             extent(face, a1, p, n)[0] - extent(other, b1, q, n)[1] > bend1 - slack;
    };
    for (const auto& [a, b] : {std::pair(&a1, &b1), std::pair(&a0, &b0)}) {
      for (const Vec3& n : separating_directions(corners_of(face, *a, p), corners_of(other, *b, q))) {
        if (n != Vec3::Zero() && (told_by(n) || told_by(-n))) {
          return true;
        }
      }
    }
    if (depth == most_refined) {
      return false;
    }
    for (const Part& a : p.split()) {
      for (const Part& b : q.split()) {
        if (!certain(a, b, 2 * level, depth + 1)) {
          return false;
        }
      }
    }
    return true;
  };
  const Part whole{{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}};
  return certain(whole, whole, 1, 0);
}

}  // namespace

bool ContactSystem::is_certain(const Configuration& configuration) {
  if (std::ranges::any_of(barriers_, &Barrier::overlaps)) {
    return false;
  }
  const auto kept = maps_at(configuration);
  const FaceMaps &now = *kept, &before = *accepted_;
  // Whatever comes near on the way is near at one end within what moves.
  double farthest = 0;
  for (std::size_t i = 0; i < reference_.size(); ++i) {
    farthest = std::max(farthest, (configuration.displacement[i] - before.configuration().displacement[i]).norm());
  }
  const auto near = near_faces(now, 2 * farthest);
  for (std::size_t number = 0; number < sides_.size(); ++number) {
    const Side& side = sides_[number];
    if (side.points || !side.other.rigid) {
      continue;  // whether a mesh passes the other body is told by that one's faces
    }
    for (std::size_t f = surfaces_.first[side.body]; f < surfaces_.first[side.body + 1]; ++f) {
      Group group = group_of_face(number, f);
      refine(group);
      if (!passes_rigid(group, before[f], now[f])) {
        return false;
      }
    }
  }
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (groups_[g].point) {
      continue;
    }
    const std::size_t f = groups_[g].face;
    for (const std::size_t other : near[g]) {
      if (!stay_apart(surfaces_.faces[f], before[f], now[f], surfaces_.faces[other], before[other], now[other],
                      same_distance * groups_[g].wall)) {
        return false;
      }
    }
  }
  return true;
}

bool ContactSystem::passes_rigid(const Group& group, const PatchMap& a0, const PatchMap& a1) const {
  const SurfaceFace& face = surfaces_.faces[group.face];
  const double slack = same_distance * group.wall;
  const RigidShape &s0 = shapes_before_[group.other.index], &s1 = shapes_[group.other.index];
  const auto far = [&](const PatchMap& m0, const PatchMap& m1, const Vec3& c0, const Vec3& c1, double reach) {
    // Distances change no faster than what moves.
    double motion = 0;
    for (int k = 0; k < (face.curved ? 9 : 3); ++k) {
      const Vec3 before = m0.points().col(k);
      motion = std::max(motion, (m1.points().col(k) - s1.carried(before, s0)).norm() + s1.detour_since(s0, before));
    }
    motion += s1.growth_since(s0);
    return s0.at(c0).distance + s1.at(c1).distance - 2 * reach > motion;
  };
  {
    const Bounds b0 = bounds_of(face, a0), b1 = bounds_of(face, a1);
    const double reach = std::max((b0.upper - b0.lower).norm(), (b1.upper - b1.lower).norm()) / 2;
    if (far(a0, a1, (b0.lower + b0.upper) / 2, (b1.lower + b1.upper) / 2, reach)) {
      return true;
    }
  }
  const std::function<bool(const Part&, int)> certain = [&](const Part& part, int level) {
    const PatchWeights weights = patch_weights(face, middle(part));
    const Vec3 c0 = a0.point(weights), c1 = a1.point(weights);
    const double bend0 = bend_of(face, a0, level), bend1 = bend_of(face, a1, level);
    for (const Vec3& n : {s1.at(c1).normal, s0.at(c0).normal}) {
      if (s0.convex() && extent(face, a0, part, n)[0] - bend0 > s0.support(n) - slack &&
          extent(face, a1, part, n)[0] - bend1 > s1.support(n) - slack) {
        return true;
      }
    }
    double reach = 0;
    for (const Vec2& at : part.at) {
      reach = std::max({reach, (a0.point(patch_weights(face, at)) - c0).norm() + bend0,
                        (a1.point(patch_weights(face, at)) - c1).norm() + bend1});
    }
    if (far(a0, a1, c0, c1, reach)) {
      return true;
    }
    const auto smaller = part.split();
    return level < group.level << most_refined &&
           std::all_of(smaller.begin(), smaller.end(), [&](const Part& p) { return certain(p, 2 * level); });
  };
  const auto parts = parts_of(group.level);
  return std::all_of(parts.begin(), parts.end(), [&](const Part& part) { return certain(part, group.level); });
}

double ContactSystem::lower_gap(const Group& group, const std::vector<std::size_t>& near, const FaceMaps& maps,
                                double upper) const {
  const SurfaceFace& face = surfaces_.faces[group.face];
  const PatchMap& a = maps[group.face];
  double lower = upper;
  // A part is split while its bound could be the smallest and lies more than this below what was sampled.
  const double close = 0.5 * upper;
  if (group.other.rigid) {
    const RigidShape& shape = shapes_[group.other.index];
    const Bounds& box = maps.bounds(group.face);
    const auto triangles = shape.convex()
                               ? std::vector<std::array<Vec3, 3>>()
                               : shape.triangles_near(box.lower, box.upper, std::max(upper, 0.0) + offset(group, 0));
    // What bounds a part bounds its parts.
    const std::function<void(const Part&, int, double)> visit = [&](const Part& part, int level, double known) {
      const double walls = offset(group, 0);
      double bound = bound_to_rigid(shape, face, a, {part, level}, triangles, {lower + walls, upper + walls});
      bound = std::max(bound - walls, known);
      if (bound >= lower) {
        return;
      }
      if (bound > upper - close || level >= group.level << most_refined) {
        lower = bound;
        return;
      }
      for (const Part& smaller : part.split()) {
        visit(smaller, 2 * level, bound);
      }
    };
    for (const Part& part : parts_of(group.level)) {
      visit(part, group.level, -infinity);
    }
    return lower;
  }
  for (const std::size_t f : near) {
    const SurfaceFace& other = surfaces_.faces[f];
    const PatchMap& b = maps[f];
    const double walls = offset(group, f);
    const std::function<void(const Part&, const Part&, int, double)> visit = [&](const Part& p, const Part& q,
                                                                                 int level, double known) {
      const double bend = bend_of(face, a, level) + bend_of(other, b, level);
      double bound = known;
      for (const Vec3& n : separating_directions(corners_of(face, a, p), corners_of(other, b, q))) {
        const auto own = extent(face, a, p, n), theirs = extent(other, b, q, n);
        if (n != Vec3::Zero()) {
          bound = std::max({bound, own[0] - theirs[1] - bend - walls, theirs[0] - own[1] - bend - walls});
        }
        if (bound >= lower) {
          return;
        }
      }
      if (bound > upper - close || level >= 1 << (2 + most_refined)) {
        lower = bound;
        return;
      }
      for (const Part& smaller : p.split()) {
        for (const Part& theirs : q.split()) {
          visit(smaller, theirs, 2 * level, bound);
        }
      }
    };
    const Part whole{{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}};
    visit(whole, whole, 1, -infinity);
  }
  return lower;
}

}  // namespace tunica
