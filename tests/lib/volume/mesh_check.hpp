#pragma once

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/surface/mesh/triangle_mesh.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace tunica::test {

/// A plain, slow check of a mesh, written apart from the library's own.
struct MeshCheck {
  std::size_t boundary_edges = 0;
  std::size_t bad_edges = 0;           ///< more than two triangles
  std::size_t inconsistent_edges = 0;  ///< two triangles that run along it in the same direction
  std::size_t bad_vertices = 0;        ///< not one fan of triangles
  std::size_t unused_vertices = 0;
  std::size_t coincident_vertices = 0;
  std::size_t components = 0;
  long euler = 0;
  double least_area = std::numeric_limits<double>::infinity();
  double least_sine = std::numeric_limits<double>::infinity();  ///< of twice the area to the longest edge squared
  double volume = 0;
  double area = 0;

  [[nodiscard]] bool manifold() const {
    return bad_edges == 0 && inconsistent_edges == 0 && bad_vertices == 0 && unused_vertices == 0;
  }
  [[nodiscard]] bool closed() const { return boundary_edges == 0; }
};

inline MeshCheck check_mesh(const TriangleMesh& mesh) {
  MeshCheck result;
  struct Use {
    int forward = 0;
    int backward = 0;
  };
  std::map<std::pair<Index, Index>, Use> edges;
  std::vector<std::vector<std::pair<Index, Index>>> links(mesh.vertices.size());
  DisjointSets pieces(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const Index a = t[i];
      const Index b = t[(i + 1) % 3];
      ++(a < b ? edges[{a, b}].forward : edges[{b, a}].backward);
      links[a].emplace_back(b, t[(i + 2) % 3]);
      pieces.join(a, b);
    }
    const Vec3& p = mesh.vertices[t[0]];
    const Vec3& q = mesh.vertices[t[1]];
    const Vec3& r = mesh.vertices[t[2]];
    const double twice_area = (q - p).cross(r - p).norm();
    const double longest = std::max({(q - p).squaredNorm(), (r - q).squaredNorm(), (p - r).squaredNorm()});
    result.least_area = std::min(result.least_area, 0.5 * twice_area);
    result.least_sine = std::min(result.least_sine, longest > 0 ? twice_area / longest : 0);
    result.volume += p.dot(q.cross(r)) / 6;
    result.area += 0.5 * twice_area;
  }
  for (const auto& [edge, use] : edges) {
    result.boundary_edges += use.forward + use.backward == 1;
    result.bad_edges += use.forward + use.backward > 2;
    result.inconsistent_edges += use.forward > 1 || use.backward > 1;
  }
  for (Index v = 0; v < mesh.vertices.size(); ++v) {
    if (links[v].empty()) {
      ++result.unused_vertices;
      continue;
    }
    result.components += pieces.root(v) == v;
    // One fan: following the link's edges from a start without predecessor (or anywhere) visits all of them.
    std::map<Index, Index> next;
    std::set<Index> ends;
    for (const auto& [from, to] : links[v]) {
      next[from] = to;
      ends.insert(to);
    }
    Index start = links[v][0].first;
    for (const auto& [from, to] : links[v]) {
      if (!ends.contains(from)) {
        start = from;
      }
    }
    std::size_t steps = 0;
    for (auto at = next.find(start); at != next.end() && steps <= links[v].size(); at = next.find(at->second)) {
      ++steps;
      if (at->second == start) {
        break;
      }
    }
    result.bad_vertices += steps != links[v].size();
  }
  std::vector<std::array<double, 3>> places;
  for (const Vec3& p : mesh.vertices) {
    places.push_back({p[0], p[1], p[2]});
  }
  std::ranges::sort(places);
  for (std::size_t i = 1; i < places.size(); ++i) {
    result.coincident_vertices += places[i] == places[i - 1];
  }
  result.euler = static_cast<long>(mesh.vertices.size() - result.unused_vertices) - static_cast<long>(edges.size()) +
                 static_cast<long>(mesh.triangles.size());
  return result;
}

/// Small reproducible generator (splitmix64).
class Random {
public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15U;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

private:
  std::uint64_t state_;
};

}  // namespace tunica::test
