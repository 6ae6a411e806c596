#include "tunica/volume/cubes/detail/cube_cases.hpp"

#include "tunica/core/error.hpp"
#include "tunica/core/types.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace tunica {
namespace {

using Loop = std::vector<std::uint8_t>;

/// Corners of each face, counter-clockwise seen from outside the cell.
constexpr std::array<std::array<std::uint8_t, 4>, 6> faces{
    {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};

std::uint8_t edge_between(std::uint8_t a, std::uint8_t b) {
  for (std::uint8_t edge = 0; edge < 12; ++edge) {
    if ((cube_edges[edge][0] == a && cube_edges[edge][1] == b) ||
        (cube_edges[edge][0] == b && cube_edges[edge][1] == a)) {
      return edge;
    }
  }
  throw InternalError("two corners of a cell that no edge joins");
}

bool on_one_face(std::uint8_t a, std::uint8_t b) {
  return std::ranges::any_of(faces, [&](const auto& face) {
    const auto has = [&](std::uint8_t edge) {
      return std::ranges::count(face, cube_edges[edge][0]) + std::ranges::count(face, cube_edges[edge][1]) == 2;
    };
    return has(a) && has(b);
  });
}

Vec3 midpoint(std::uint8_t edge) {
  const auto corner = [](int c) { return Vec3(c & 1, c >> 1 & 1, c >> 2); };
  return 0.5 * (corner(cube_edges[edge][0]) + corner(cube_edges[edge][1]));
}

/// Cosine of the triangle's smallest angle, negated: larger is better; -1 for a triangle without area.
double shape(std::uint8_t a, std::uint8_t b, std::uint8_t c) {
  const std::array<Vec3, 3> p{midpoint(a), midpoint(b), midpoint(c)};
  double largest_cosine = -1;
  for (int i = 0; i < 3; ++i) {
    const Vec3 u = p[(i + 1) % 3] - p[i];
    const Vec3 v = p[(i + 2) % 3] - p[i];
    largest_cosine = std::max(largest_cosine, u.dot(v) / (u.norm() * v.norm()));
  }
  return -largest_cosine;
}

/// Closed paths of crossed edges. On every face, each run of inside corners is cut off by one segment, from the edge by
/// which the counter-clockwise walk enters the run to the edge by which it leaves: seen from outside, inside is on the
/// left. A neighbour walks the shared face the other way, so its segment is the same, reversed.
std::vector<Loop> trace_loops(unsigned inside) {
  const auto in = [&](std::uint8_t corner) { return (inside >> corner & 1) != 0; };
  std::map<std::uint8_t, std::uint8_t> next;
  for (const auto& face : faces) {
    for (int start = 0; start < 4; ++start) {
      const std::uint8_t before = face[(start + 3) % 4];
      if (!in(face[start]) || in(before)) {
        continue;
      }
      int last = start;
      while (in(face[(last + 1) % 4])) {
        ++last;
      }
      next[edge_between(before, face[start])] = edge_between(face[last % 4], face[(last + 1) % 4]);
    }
  }
  std::vector<Loop> loops;
  while (!next.empty()) {
    Loop loop;
    for (auto link = next.begin(); link != next.end(); link = next.find(loop.back())) {
      loop.push_back(link->second);
      next.erase(link);
    }
    loops.push_back(loop);
  }
  return loops;
}

/// Adds the triangulation of a loop whose worst triangle is best, among those without a diagonal inside a face.
void triangulate(const Loop& loop, CubeCase& result) {
  constexpr double impossible = -infinity;
  const std::size_t n = loop.size();
  std::vector<std::vector<std::pair<double, std::size_t>>> best(
      n, std::vector<std::pair<double, std::size_t>>(n, {infinity, 0}));
  const auto allowed = [&](std::size_t i, std::size_t j) {
    return j == i + 1 || (i == 0 && j == n - 1) || !on_one_face(loop[i], loop[j]);
  };
  for (std::size_t span = 2; span < n; ++span) {
    for (std::size_t i = 0; i + span < n; ++i) {
      const std::size_t j = i + span;
      best[i][j] = {impossible, 0};
      for (std::size_t k = i + 1; allowed(i, j) && k < j; ++k) {
        const double quality = shape(loop[i], loop[k], loop[j]);
        const double worst = std::min({best[i][k].first, best[k][j].first, quality});
        if (quality > -1 + 1e-6 && worst > best[i][j].first) {
          best[i][j] = {worst, k};
        }
      }
    }
  }
  TUNICA_ASSERT(best[0][n - 1].first != impossible);
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, n - 1}};
  while (!open.empty()) {
    const auto [i, j] = open.back();
    open.pop_back();
    if (j - i >= 2) {
      const std::size_t k = best[i][j].second;
      result.triangles.at(result.count++) = {loop[i], loop[k], loop[j]};
      open.emplace_back(k, j);
      open.emplace_back(i, k);
    }
  }
}

}  // namespace

const std::array<CubeCase, 256>& cube_cases() {
  static const std::array<CubeCase, 256> cases = [] {
    std::array<CubeCase, 256> result;
    for (unsigned inside = 0; inside < 256; ++inside) {
      for (const Loop& loop : trace_loops(inside)) {
        triangulate(loop, result[inside]);
      }
    }
    return result;
  }();
  return cases;
}

}  // namespace tunica
