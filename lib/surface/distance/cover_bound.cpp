#include "tunica/surface/distance/cover_bound.hpp"

#include "tunica/core/threads.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace tunica {
namespace {

// A point of B seen along the normal of s: signed distances to the three sides of s (inside positive), and height.
struct Seen {
  std::array<double, 3> inside;
  double height;
};

Seen between(const Seen& a, const Seen& b, double t) {
  Seen p;
  for (std::size_t k = 0; k < 3; ++k) {
    p.inside[k] = a.inside[k] + t * (b.inside[k] - a.inside[k]);
  }
  p.height = a.height + t * (b.height - a.height);
  return p;
}

// Whether some of the segment from a to b lies over s.
bool crosses(const Seen& a, const Seen& b) {
  double begin = 0;
  double end = 1;
  for (std::size_t k = 0; k < 3; ++k) {
    if (a.inside[k] < 0 && b.inside[k] < 0) {
      return false;
    }
    if (a.inside[k] < 0) {
      begin = std::max(begin, a.inside[k] / (a.inside[k] - b.inside[k]));
    } else if (b.inside[k] < 0) {
      end = std::min(end, a.inside[k] / (a.inside[k] - b.inside[k]));
    }
  }
  return begin <= end;
}

// The largest height, up or down, of the part of a triangle that lies over s; negative when no part does.
double largest_height(const std::array<Seen, 3>& triangle) {
  const auto least_inside = [&](const Seen& p) { return std::min({p.inside[0], p.inside[1], p.inside[2]}); };
  if (std::min({least_inside(triangle[0]), least_inside(triangle[1]), least_inside(triangle[2])}) >= 0) {
    return std::max({std::abs(triangle[0].height), std::abs(triangle[1].height), std::abs(triangle[2].height)});
  }
  for (std::size_t side = 0; side < 3; ++side) {
    if (std::max({triangle[0].inside[side], triangle[1].inside[side], triangle[2].inside[side]}) < 0) {
      return -1;
    }
  }
  std::array<Seen, 9> polygon;
  std::copy(triangle.begin(), triangle.end(), polygon.begin());
  std::size_t count = 3;
  for (std::size_t side = 0; side < 3; ++side) {
    std::array<Seen, 9> clipped;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const Seen& a = polygon[i];
      const Seen& b = polygon[(i + 1) % count];
      if (a.inside[side] >= 0) {
        clipped[kept++] = a;
      }
      if ((a.inside[side] >= 0) != (b.inside[side] >= 0)) {
        clipped[kept++] = between(a, b, a.inside[side] / (a.inside[side] - b.inside[side]));
      }
    }
    polygon = clipped;
    count = kept;
  }
  double height = -1;
  for (std::size_t i = 0; i < count; ++i) {
    height = std::max(height, std::abs(polygon[i].height));
  }
  return height;
}

// Whether the triangle has an edge from u to v.
bool runs(const std::array<Index, 3>& triangle, Index u, Index v) {
  return (triangle[0] == u && triangle[1] == v) || (triangle[1] == u && triangle[2] == v) ||
         (triangle[2] == u && triangle[0] == v);
}

}  // namespace

CoverBound::Visited::Visited() : table_(slots, no_neighbour) { list_.reserve(limit); }

void CoverBound::Visited::clear() {
  for (const Index triangle : list_) {
    for (std::size_t slot = triangle % slots; table_[slot] != no_neighbour; slot = (slot + 1) % slots) {
      table_[slot] = no_neighbour;
    }
  }
  list_.clear();
}

bool CoverBound::Visited::insert(Index triangle) {
  std::size_t slot = triangle % slots;
  for (; table_[slot] != no_neighbour; slot = (slot + 1) % slots) {
    if (table_[slot] == triangle) {
      return false;
    }
  }
  if (full()) {
    return false;
  }
  table_[slot] = triangle;
  list_.push_back(triangle);
  return true;
}

CoverBound::CoverBound(const ClosestPoint& surface)
    : CoverBound(surface, incidence(surface.vertices().size(), surface.triangles())) {}

CoverBound::CoverBound(const ClosestPoint& surface, const Incidence& around)
    : surface_(surface), across_(neighbours(surface.triangles(), around)) {
  const auto& triangles = surface.triangles();
  parallel_for_blocks(triangles.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (across_[t][k] != no_neighbour &&
            !runs(triangles[across_[t][k]], triangles[t][(k + 1) % 3], triangles[t][k])) {
          across_[t][k] = no_neighbour;
        }
      }
    }
  });
}

double CoverBound::operator()(const std::array<Vec3, 3>& corners, Index start, double give_up, Visited& visited) const {
  const Vec3& origin = corners[0];
  const Vec3 side1 = corners[1] - origin;
  const Vec3 side2 = corners[2] - origin;
  const Vec3 cross = side1.cross(side2);
  const double doubled_area = cross.norm();
  const double squared_longest = std::max({side1.squaredNorm(), side2.squaredNorm(), (side2 - side1).squaredNorm()});
  if (!(doubled_area > 1e-7 * squared_longest)) {
    return infinity;
  }
  const Vec3 normal = cross / doubled_area;
  const double longest = std::sqrt(squared_longest);
  // s grows by this much, so that rounding never loses a crossing.
  const double margin = 1e-7 * longest;
  const double out_of_plane = std::max(std::abs(normal.dot(side1)), std::abs(normal.dot(side2)));
  std::array<Vec3, 3> inward;
  std::array<double, 3> offset;
  for (std::size_t k = 0; k < 3; ++k) {
    inward[k] = normal.cross(corners[(k + 1) % 3] - corners[k]).normalized();
    offset[k] = margin - inward[k].dot(corners[k] - origin);
  }
  const auto see = [&](Index vertex) {
    const Vec3 p = surface_.vertices()[vertex] - origin;
    return Seen{{inward[0].dot(p) + offset[0], inward[1].dot(p) + offset[1], inward[2].dot(p) + offset[2]},
                normal.dot(p)};
  };
  visited.clear();
  visited.insert(start);
  double highest = -1;
  double facing = 0;
  for (std::size_t i = 0; i < visited.list().size(); ++i) {
    const Index t = visited.list()[i];
    const auto& triangle = surface_.triangles()[t];
    const std::array<Seen, 3> seen{see(triangle[0]), see(triangle[1]), see(triangle[2])};
    const double height = largest_height(seen);
    if (height < 0) {
      continue;
    }
    highest = std::max(highest, height);
    const auto [a, b, c] = surface_.corners(t);
    const Vec3 edge1 = b - a;
    const Vec3 edge2 = c - a;
    const double projected = normal.dot(edge1.cross(edge2));
    const double extent = std::max(edge1.squaredNorm(), edge2.squaredNorm());
    if (facing == 0) {
      facing = projected;
    }
    // Seen edge-on, or far larger than s, a triangle's side cannot be told from rounding.
    if (highest > give_up || !(projected * facing > 0) || std::abs(projected) < 1e-10 * extent ||
        extent > 1e26 * margin * margin) {
      return infinity;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (!crosses(seen[k], seen[(k + 1) % 3])) {
        continue;
      }
      const Index other = across_[t][k];
      if (other == no_neighbour || (!visited.insert(other) && visited.full())) {
        return infinity;
      }
    }
  }
  return highest < 0 ? infinity : highest + out_of_plane;
}

}  // namespace tunica
