#include "tunica/core/error.hpp"
#include "tunica/core/progress.hpp"
#include "tunica/io/mesh/detail/mesh_formats.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>

#include <algorithm>

namespace tunica {
namespace {

constexpr std::size_t max_concave_corners = 1024;  // ear cutting is quadratic

/// Twice the polygon's vector area, relative to its first corner (Newell).
Vec3 vector_area(std::span<const Vec3> points) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    sum += (points[i] - points[0]).cross(points[i + 1] - points[0]);
  }
  return sum;
}

double turn(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

bool is_convex(std::span<const Vec2> points) {
  // A fan is right exactly when the polygon turns left at every corner and every triangle of the fan does too.
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (turn(points[i], points[(i + 1) % points.size()], points[(i + 2) % points.size()]) < 0) {
      return false;
    }
  }
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    if (turn(points[0], points[i], points[i + 1]) < 0) {
      return false;
    }
  }
  return true;
}

bool is_ear(std::span<const Vec2> points, std::span<const std::size_t> loop, std::size_t tip) {
  const std::size_t n = loop.size();
  const Vec2& a = points[loop[(tip + n - 1) % n]];
  const Vec2& b = points[loop[tip]];
  const Vec2& c = points[loop[(tip + 1) % n]];
  if (turn(a, b, c) <= 0) {
    return false;
  }
  for (std::size_t k = 0; k + 3 < n; ++k) {
    const Vec2& p = points[loop[(tip + 2 + k) % n]];
    if (p != a && p != b && p != c && turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0) {
      return false;
    }
  }
  return true;
}

/// Appends n - 2 triangles. What has no ear (it crosses itself, or has no area) ends as a fan.
void cut_ears(std::span<const Index> corners, std::span<const Vec2> points,
              std::vector<std::array<Index, 3>>& triangles) {
  std::vector<std::size_t> loop(corners.size());
  for (std::size_t i = 0; i < loop.size(); ++i) {
    loop[i] = i;
  }
  while (loop.size() > 3) {
    std::size_t tip = 0;
    while (tip < loop.size() && !is_ear(points, loop, tip)) {
      ++tip;
    }
    if (tip == loop.size()) {
      break;
    }
    const std::size_t n = loop.size();
    triangles.push_back({corners[loop[(tip + n - 1) % n]], corners[loop[tip]], corners[loop[(tip + 1) % n]]});
    loop.erase(loop.begin() + tip);
  }
  for (std::size_t i = 1; i + 1 < loop.size(); ++i) {
    triangles.push_back({corners[loop[0]], corners[loop[i]], corners[loop[i + 1]]});
  }
}

void split(std::span<const Index> corners, const std::vector<Vec3>& vertices, const std::string& name, std::size_t face,
           std::vector<std::array<Index, 3>>& triangles) {
  std::vector<Vec3> points;
  points.reserve(corners.size());
  for (const Index corner : corners) {
    points.push_back(vertices[corner]);
  }
  const Vec3 normal = vector_area(points);
  int drop = 0;  // the coordinate to leave out, so that the polygon stays widest and counter-clockwise
  normal.cwiseAbs().maxCoeff(&drop);
  const bool flip = normal[drop] < 0;
  std::vector<Vec2> flat;
  flat.reserve(points.size());
  for (const Vec3& p : points) {
    const double u = p[(drop + 1) % 3];
    const double v = p[(drop + 2) % 3];
    flat.push_back(flip ? Vec2(v, u) : Vec2(u, v));
  }
  if (is_convex(flat)) {
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
      triangles.push_back({corners[0], corners[i], corners[i + 1]});
    }
    return;
  }
  if (corners.size() > max_concave_corners) {
    throw InputError(
        fmt::format("{}: face {} is a concave polygon of {} corners, at most {} are understood: split it "
                    "into triangles first",
                    name, face, corners.size(), max_concave_corners));
  }
  cut_ears(corners, flat, triangles);
}

}  // namespace

void FaceCollector::add(std::span<const Index> corners) {
  if (corners.size() < 3) {
    throw InputError(
        fmt::format("{}: face {} has {} corners, at least 3 are expected", name_, faces(), corners.size()));
  }
  if (corners.size() == 3) {
    add(corners[0], corners[1], corners[2]);
  } else {
    polygons_.push_back({triangles_.size(), {corners.begin(), corners.end()}});
  }
}

void FaceCollector::check(std::span<const Index> corners, std::vector<bool>& used) {
  for (const Index corner : corners) {
    if (corner >= used.size()) {
      throw InputError(fmt::format("{}: face {} names vertex {}, but there are only {} (counted from 0)", name_,
                                   checked_, corner, used.size()));
    }
    faces_are_apart_ = faces_are_apart_ && !used[corner];
  }
  for (const Index corner : corners) {
    used[corner] = true;
  }
  ++checked_;
}

void FaceCollector::finish(MeshFile& file) {
  const std::vector<Vec3>& vertices = file.mesh.vertices;
  std::vector<std::array<Index, 3>>& result = file.mesh.triangles;
  std::vector<bool> used(vertices.size(), false);
  std::size_t done = 0;
  for (const Polygon& polygon : polygons_) {
    for (; done < polygon.triangles_before; ++done) {
      check(triangles_[done], used);
      result.push_back(triangles_[done]);
    }
    check(polygon.corners, used);
    split(polygon.corners, vertices, name_, checked_ - 1, result);
    check_interrupt();
  }
  for (std::size_t t = done; t < triangles_.size(); ++t) {
    check(triangles_[t], used);
  }
  if (result.empty()) {
    result = std::move(triangles_);
  } else {
    result.insert(result.end(), triangles_.begin() + done, triangles_.end());
  }
  if (faces_are_apart_ && file.normals.empty() && file.vertex_properties.empty()) {
    weld_exactly(file.mesh);
  }
}

}  // namespace tunica
