#include "tunica/surface/mesh/cut_open.hpp"

#include "tunica/core/disjoint_sets.hpp"
#include "tunica/core/error.hpp"
#include "tunica/core/narrow.hpp"
#include "tunica/core/rounding.hpp"
#include "tunica/surface/mesh/checks.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>
#include <utility>

namespace tunica {
namespace {

constexpr double nearest = 0.25;  // of an edge, for a vertex that moves into the plane

class Cut {
public:
  Cut(const TriangleMesh& surface, const Vec3& normal, double offset) : mesh_(surface) {
    height_.reserve(mesh_.vertices.size());
    for (const Vec3& x : mesh_.vertices) {
      height_.push_back(normal.dot(x) - offset);
    }
  }

  TriangleMesh run() {
    move_into_plane();
    std::vector<std::array<Index, 3>> kept;
    for (const auto& t : mesh_.triangles) {
      keep(t, kept);
    }
    mesh_.triangles = std::move(kept);
    part_at_points();
    return without_unused(std::move(mesh_));
  }

private:
  [[nodiscard]] bool crosses(Index a, Index b) const { return height_[a] * height_[b] < 0; }

  /// Of all edges of a vertex that cross the plane near it, along the one that does so nearest.
  void move_into_plane() {
    std::unordered_map<Index, std::pair<double, Index>> moves;  // by vertex: part of the edge, its other end
    for (const auto& t : mesh_.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        for (const auto& [a, b] : {std::pair(t[k], t[(k + 1) % 3]), std::pair(t[(k + 1) % 3], t[k])}) {
          const double part = crosses(a, b) ? height_[a] / (height_[a] - height_[b]) : 1;
          if (part >= nearest) {
            continue;
          }
          const auto [place, fresh] = moves.try_emplace(a, part, b);
          if (!fresh) {
            place->second = std::min(place->second, std::pair(part, b));
          }
        }
      }
    }
    std::vector<std::pair<Index, Vec3>> moved;
    for (const auto& [vertex, move] : moves) {
      const auto& [part, end] = move;
      moved.emplace_back(vertex, mesh_.vertices[vertex] + part * (mesh_.vertices[end] - mesh_.vertices[vertex]));
    }
    for (const auto& [vertex, place] : moved) {
      mesh_.vertices[vertex] = place;
      height_[vertex] = 0;
    }
  }

  Index crossing(Index a, Index b) {
    const auto [place, fresh] = crossings_.try_emplace(std::minmax(a, b), narrow<Index>(mesh_.vertices.size()));
    if (fresh) {
      const auto& [low, high] = place->first;  // in this order, so that both triangles at the edge find the same point
      const double part = height_[low] / (height_[low] - height_[high]);
      mesh_.vertices.emplace_back(mesh_.vertices[low] + part * (mesh_.vertices[high] - mesh_.vertices[low]));
      height_.push_back(0);
    }
    return place->second;
  }

  void keep(const std::array<Index, 3>& t, std::vector<std::array<Index, 3>>& kept) {
    if (std::ranges::none_of(t, [&](Index v) { return height_[v] < 0; })) {
      return;
    }
    std::vector<Index> polygon;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k];
      const Index b = t[(k + 1) % 3];
      if (height_[a] <= 0) {
        polygon.push_back(a);
      }
      if (crosses(a, b)) {
        polygon.push_back(crossing(a, b));
      }
    }
    if (polygon.size() == 4) {  // by the shorter diagonal
      const auto squared = [&](std::size_t i, std::size_t j) {
        return (mesh_.vertices[polygon[i]] - mesh_.vertices[polygon[j]]).squaredNorm();
      };
      if (squared(1, 3) < squared(0, 2)) {
        std::rotate(polygon.begin(), polygon.begin() + 1, polygon.end());
      }
      kept.push_back({polygon[0], polygon[1], polygon[2]});
      kept.push_back({polygon[0], polygon[2], polygon[3]});
    } else if (polygon.size() == 3) {
      kept.push_back({polygon[0], polygon[1], polygon[2]});
    }
  }

  /// Corners at a vertex in the plane belong together where their triangles share an edge there.
  void part_at_points() {
    auto& triangles = mesh_.triangles;
    DisjointSets joined(3 * triangles.size());
    std::map<std::array<Index, 2>, std::size_t> edges;  // (vertex, other end) -> corner
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index v = triangles[t][k];
        if (height_[v] != 0) {
          continue;
        }
        for (const std::size_t other : {(k + 1) % 3, (k + 2) % 3}) {
          const auto [place, fresh] = edges.try_emplace({v, triangles[t][other]}, 3 * t + k);
          if (!fresh) {
            joined.join(narrow<Index>(place->second), narrow<Index>(3 * t + k));
          }
        }
      }
    }
    std::map<Index, Index> vertex_of;  // by fan
    std::vector<char> taken(mesh_.vertices.size(), 0);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Index v = triangles[t][k];
        if (height_[v] != 0) {
          continue;
        }
        const auto [place, fresh] = vertex_of.try_emplace(joined.root(narrow<Index>(3 * t + k)), v);
        if (fresh && std::exchange(taken[v], 1) != 0) {
          place->second = narrow<Index>(mesh_.vertices.size());
          mesh_.vertices.push_back(Vec3(mesh_.vertices[v]));
          height_.push_back(0);
        }
        triangles[t][k] = place->second;
      }
    }
  }

  TriangleMesh mesh_;
  std::vector<double> height_;                          // over the plane
  std::map<std::pair<Index, Index>, Index> crossings_;  // by edge
};

}  // namespace

TriangleMesh cut_open(const TriangleMesh& surface, const Vec3& normal, double offset) {
  require_valid(surface);
  if (!is_unit(normal) || !std::isfinite(offset)) {
    throw InputError("a plane to cut along has a unit normal and a finite offset");
  }
  return Cut(surface, normal, offset).run();
}

}  // namespace tunica
