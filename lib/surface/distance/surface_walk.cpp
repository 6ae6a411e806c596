#include "tunica/surface/distance/surface_walk.hpp"

#include "tunica/core/narrow.hpp"
#include "tunica/surface/mesh/measure.hpp"
#include "tunica/surface/mesh/subdivide.hpp"

#include <algorithm>
#include <cmath>

namespace tunica {

std::array<double, 2> FlatTriangle::closest(const Vec3& p) const {
  const Vec3 ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) {
    return {0, 0};
  }
  const double d3 = d1 - ab_ab;
  const double d4 = d2 - ab_ac;
  if (d3 >= 0 && d4 <= d3) {
    return {1, 0};
  }
  const double d5 = d1 - ab_ac;
  const double d6 = d2 - ac_ac;
  if (d6 >= 0 && d5 <= d6) {
    return {0, 1};
  }
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    return {d1 / (d1 - d3), 0};
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    return {0, d2 / (d2 - d6)};
  }
  const double va = d3 * d6 - d5 * d4;
  const double along = d4 - d3;
  const double back = d5 - d6;
  if (va <= 0 && along >= 0 && back >= 0) {
    const double w = along + back > 0 ? along / (along + back) : 0;
    return {1 - w, w};
  }
  // In a triangle almost without area these are rounding: within it all the same, so that no distance is too small.
  const double sum = va + vb + vc;
  const double x = sum > 0 ? std::clamp(vb / sum, 0.0, 1.0) : 0;
  const double y = sum > 0 ? std::clamp(vc / sum, 0.0, 1 - x) : 0;
  return {x, y};
}

SurfaceWalk::SurfaceWalk(const TriangleMesh& mesh) : mesh_(mesh), around_(incidence(mesh)) {
  const Box box = bounding_box(mesh);
  origin_ = box.lower;
  // About as many cubes as vertices: most are empty, the others hold a few.
  const Vec3 size = box.upper - box.lower;
  const double least = 1e-3 * size.maxCoeff();
  const double volume = std::max(size.x(), least) * std::max(size.y(), least) * std::max(size.z(), least);
  cells_per_mm_ = std::cbrt(real(mesh.vertices.size()) / volume);
  for (int axis = 0; axis < 3; ++axis) {
    cells_[axis] = truncated<std::size_t>(size[axis] * cells_per_mm_) + 1;
  }
  std::vector<std::uint64_t> following(mesh.vertices.size(), 0), preceding(mesh.vertices.size(), 0);
  for (const auto& c : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      following[c[k]] += c[(k + 1) % 3];
      preceding[c[k]] += c[(k + 2) % 3];
    }
  }
  at_boundary_.resize(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    at_boundary_[v] = following[v] != preceding[v] ? 1 : 0;
  }
  place_points();
}

void SurfaceWalk::place_points() {
  constexpr double most_parts = 64;
  constexpr double most_points = 32;  // per triangle, in the mean
  std::vector<Placed> points;
  points.reserve(mesh_.vertices.size());
  for (Index v = 0; v < mesh_.vertices.size(); ++v) {
    if (!around_.of(v).empty()) {
      points.push_back({mesh_.vertices[v], around_.of(v)[0]});
    }
  }
  const std::vector<int> parts_of = parts_for_points(
      mesh_, [&](double longest) { return std::min(longest * cells_per_mm_, most_parts); },
      most_points * real(mesh_.triangles.size()));
  for (Index t = 0; t < mesh_.triangles.size(); ++t) {
    const auto& [i, j, k] = mesh_.triangles[t];
    const Vec3& a = mesh_.vertices[i];
    const Vec3 ab = mesh_.vertices[j] - a;
    const Vec3 ac = mesh_.vertices[k] - a;
    const int parts = parts_of[t];
    for (int x = 0; x < parts; ++x) {
      for (int y = 0; x + y < parts && parts > 1; ++y) {
        points.push_back({a + ((x + 1.0 / 3) * ab + (y + 1.0 / 3) * ac) / parts, t});
      }
    }
  }
  std::vector<Index> cube(points.size());
  offsets_.assign(cells_[0] * cells_[1] * cells_[2] + 1, 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    cube[i] = cube_of(points[i].at);
    ++offsets_[cube[i]];
  }
  Index end = 0;
  for (Index& offset : offsets_) {
    end += offset;
    offset = end;
  }
  placed_.resize(points.size());
  for (std::size_t i = points.size(); i-- > 0;) {
    placed_[--offsets_[cube[i]]] = points[i];
  }
}

Index SurfaceWalk::cube_of(const Vec3& p) const {
  return narrow<Index>((cell(p.x(), 0) * cells_[1] + cell(p.y(), 1)) * cells_[2] + cell(p.z(), 2));
}

std::size_t SurfaceWalk::cell(double x, int axis) const {
  const double place = (x - origin_[axis]) * cells_per_mm_;
  return truncated<std::size_t>(std::clamp(place, 0.0, real(cells_[axis] - 1)));
}

/// A vertex nearer than its neighbours.
Index SurfaceWalk::downhill(const Vec3& p, Index start) const {
  const auto squared_to = [&](Index vertex) { return (p - mesh_.vertices[vertex]).squaredNorm(); };
  Index nearest = mesh_.triangles[start][0];
  double least = squared_to(nearest);
  const auto try_vertex = [&](Index v) {
    const double squared = squared_to(v);
    if (squared < least) {
      least = squared;
      nearest = v;
    }
  };
  try_vertex(mesh_.triangles[start][1]);
  try_vertex(mesh_.triangles[start][2]);
  // Each neighbour follows the centre in one triangle; at a boundary one of them only precedes it.
  for (Index centre = no_neighbour; centre != nearest;) {
    centre = nearest;
    for (const std::size_t step : {std::size_t{1}, std::size_t{2}}) {
      for (const Index t : around_.of(centre)) {
        const auto& c = mesh_.triangles[t];
        const std::size_t k = c[0] == centre ? 0 : c[1] == centre ? 1 : 2;
        try_vertex(c[(k + step) % 3]);
      }
      if (nearest != centre || at_boundary_[centre] == 0) {
        break;
      }
    }
  }
  return nearest;
}

/// Takes a triangle if it is closer than `hit`; `place` says where in it.
void SurfaceWalk::try_triangle(Index t, const Vec3& p, ClosestPoint::Hit& hit, std::array<double, 2>& place) const {
  const auto& [i, j, k] = mesh_.triangles[t];
  const FlatTriangle triangle(mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]);
  const auto at = triangle.closest(p);
  const Vec3 point = triangle.a + at[0] * triangle.ab + at[1] * triangle.ac;
  const double squared = (p - point).squaredNorm();
  if (squared < hit.squared_distance) {
    hit = {point, t, squared};
    place = at;
  }
}

void SurfaceWalk::search_around(Index vertex, const Vec3& p, ClosestPoint::Hit& hit,
                                std::array<double, 2>& place) const {
  for (const Index t : around_.of(vertex)) {
    try_triangle(t, p, hit, place);
  }
}

/// The first triangle and those around the nearest vertex, until one is near enough. @return that vertex
Index SurfaceWalk::search_near(Index start, const Vec3& p, double enough, ClosestPoint::Hit& hit,
                               std::array<double, 2>& place) const {
  if (enough > 0) {
    try_triangle(start, p, hit, place);
    if (hit.squared_distance <= enough) {
      return no_neighbour;
    }
  }
  const Index nearest = downhill(p, start);
  for (const Index t : around_.of(nearest)) {
    try_triangle(t, p, hit, place);
    if (hit.squared_distance <= enough) {
      break;
    }
  }
  return nearest;
}

ClosestPoint::Hit SurfaceWalk::near_by(const Vec3& p, Index start, double enough) const {
  ClosestPoint::Hit hit;
  std::array<double, 2> place{};
  search_near(start, p, enough, hit, place);
  return hit;
}

ClosestPoint::Hit SurfaceWalk::closest(const Vec3& p, Index start, double enough) const {
  constexpr std::size_t most_steps = 64;
  ClosestPoint::Hit hit;
  std::array<double, 2> place{};
  Index centre = enough > 0 ? search_near(start, p, enough, hit, place) : downhill(p, start);
  if (hit.squared_distance <= enough) {
    return hit;
  }
  // Only points nearer than this vertex can do better.
  double least = (p - mesh_.vertices[centre]).squaredNorm();
  const double reach = std::sqrt(least);
  const std::array<std::size_t, 3> low{cell(p.x() - reach, 0), cell(p.y() - reach, 1), cell(p.z() - reach, 2)};
  const std::array<std::size_t, 3> high{cell(p.x() + reach, 0), cell(p.y() + reach, 1), cell(p.z() + reach, 2)};
  Index nearest = no_neighbour;
  for (std::size_t i = low[0]; i <= high[0]; ++i) {
    for (std::size_t j = low[1]; j <= high[1]; ++j) {
      const std::size_t row = (i * cells_[1] + j) * cells_[2];
      for (Index k = offsets_[row + low[2]]; k < offsets_[row + high[2] + 1]; ++k) {
        const double squared = (p - placed_[k].at).squaredNorm();
        if (squared < least) {
          least = squared;
          nearest = placed_[k].triangle;
        }
      }
    }
  }
  if (nearest != no_neighbour) {
    search_around(centre, p, hit, place);  // of two sheets the other may be the nearer one
    for (const Index v : mesh_.triangles[nearest]) {
      search_around(v, p, hit, place);
    }
    const auto squared_to = [&](Index v) { return (p - mesh_.vertices[v]).squaredNorm(); };
    const auto& c = mesh_.triangles[hit.triangle];
    centre = *std::min_element(c.begin(), c.end(), [&](Index l, Index r) { return squared_to(l) < squared_to(r); });
  }
  for (std::size_t step = 0; step < most_steps; ++step) {
    const double before = hit.squared_distance;
    search_around(centre, p, hit, place);
    if ((step > 0 && !(hit.squared_distance < before)) || (place[0] > 0 && place[1] > 0 && place[0] + place[1] < 1)) {
      break;
    }
    // On an edge or at a corner: on around the nearer end of it that has not been the centre.
    const auto& c = mesh_.triangles[hit.triangle];
    const std::array<double, 3> share{1 - place[0] - place[1], place[0], place[1]};
    Index next = centre;
    double next_squared = infinity;
    for (std::size_t k = 0; k < 3; ++k) {
      const double squared = (hit.point - mesh_.vertices[c[k]]).squaredNorm();
      if (c[k] != centre && share[k] > 0 && squared < next_squared) {
        next_squared = squared;
        next = c[k];
      }
    }
    if (next == centre) {
      break;
    }
    centre = next;
  }
  return hit;
}

}  // namespace tunica
